"""A trial: which steps are in it, when it is certain, and that no count is wrong in silence."""

from __future__ import annotations

import csv
import io
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pipeline.stand import START_NS, Stand

from service.errors import NotNowError, ParameterError, UnknownNumberError
from service.events import Counting, Gap, Rebooted, Segmented, StepCounted
from service.pipeline import trials as trials_module
from service.pipeline.lifecycle import State as LinkState
from service.pipeline.lineup import lineup
from service.pipeline.notices import Notice, StateChanged
from service.pipeline.trial import Cause, Count, Entry, Finish, State, Trial, advance, mean
from service.pipeline.trial_table import COLUMNS, table_csv
from service.pipeline.trials import Trials
from service.samples import Step

S = 1_000_000_000


def told(at_s, event):
    return Notice(device="a", at_ns=round(at_s * S), uncertainty_s=0.0, ordinal=None, event=event)


def step(at_s, counter="c"):
    return told(at_s, StepCounted(counter=counter, boot=1, steps=0, step=Step(at_s=at_s, strength=1.0)))


def counting(at_s, pending=0):
    return told(at_s, Counting(now_s=at_s, steps=0, steps_now=pending, cadence_spm=None))


def unsure(at_s, uncertainty_s):
    return replace(counting(at_s), uncertainty_s=uncertainty_s)


def gap(to_s, seconds, *, filled=False):
    return told(to_s, Gap(from_s=to_s - seconds, to_s=to_s, index=0, samples=1, filled=filled))


def link(at_s, state):
    return told(at_s, StateChanged(state=state, reason=None))


def begun_at(at_s=10.0):
    return Count(Entry(device="a", counter="c"), round(at_s * S))


def ended(count, at_s, *, latency_s=3.0, remarks=()):
    count.finish(round(at_s * S), Finish(latency_s=latency_s, remarks=remarks))


def played(*notices, end_s=20.0, **end):
    """A count that began at 10 s, heard `notices` and ended at `end_s`."""
    count = begun_at()
    for notice in notices:
        count.take(notice)
    ended(count, end_s, **end)
    return count


# Which steps


@given(before=st.lists(st.floats(0, 9.9)), inside=st.lists(st.floats(10, 20)), after=st.lists(st.floats(20.1, 30)))
def test_steps_within_the_trial_are_counted_whenever_they_are_confirmed(before, inside, after):
    early, late = inside[::2], inside[1::2]
    count = played(*(step(at_s) for at_s in (*before, *early)))
    for at_s in (*late, *after):
        count.take(step(at_s))
    assert count.steps == len(inside)
    assert count.note(0) is None


def test_only_the_primarys_steps_count():
    count = played(step(11), step(12, counter="another"), step(13))
    assert count.steps == 2


def test_it_is_certain_once_the_stream_has_passed_the_end_by_the_latency():
    count = played(step(11), latency_s=3.0)
    count.take(counting(22.9))
    assert not count.settled
    count.take(step(19.5))
    count.take(counting(23.0))
    assert count.settled
    count.take(step(19.9))
    assert count.steps == 2


def test_likely_steps_are_shown_while_they_may_still_count():
    count = begun_at()
    for notice in (step(11), counting(12, pending=4)):
        count.take(notice)
    assert (count.steps, count.steps_now) == (1, 5)
    ended(count, 12.5)
    count.take(counting(13, pending=9))  # steps after the end
    assert count.steps_now == 5
    count.take(step(12))
    count.take(counting(15.5))
    assert (count.steps, count.steps_now) == (2, 2)


# What makes it doubtful


@pytest.mark.parametrize(
    ("notices", "said"),
    [
        ([told(15, Segmented(primary="c", steps=0))], "parameters were changed after 0 steps"),
        ([gap(15, 2.5)], "samples missing for 2.5 s"),
        ([gap(15, 2.5), gap(18, 1.0)], "samples missing for 3.5 s"),
        ([gap(15, 0.3, filled=True)], "0.30 s of samples bridged"),
        ([unsure(12, 0.6), unsure(13, 0.1)], "times known to 0.6 s only"),
        ([told(15, Rebooted(boot=2, previous=1))], "started again"),
        (
            [link(15, LinkState.LOST), link(16, LinkState.CONNECTING), link(18, LinkState.STREAMING)],
            "connected for 3.0",
        ),
        ([step(12), told(15, Segmented(primary="d", steps=1))], "counter changed to d after 1 steps"),
    ],
)
def test_what_may_have_cost_steps_is_noted(notices, said):
    assert said in played(*notices).note(0)


def test_what_was_before_the_trial_is_not_noted():
    assert played(gap(9.9, 5), unsure(15, 0.2)).note(0) is None


def test_what_hurts_the_last_steps_after_the_end_is_noted_too():
    count = played(step(19))
    count.take(gap(22, 1.5))
    count.take(counting(30))
    assert count.settled
    assert "samples missing for 1.5 s" in count.note(0)


def test_a_device_that_is_away_says_since_when():
    count = begun_at()
    count.take(link(15, LinkState.LOST))
    assert "not connected for 2.0 s" in count.note(17 * S)
    assert "not connected for 4.0 s" in count.note(19 * S)


def test_a_device_lost_at_the_end_settles_at_once_and_says_how_many_are_left_out():
    count = played(step(11), counting(14, pending=3), link(15, LinkState.LOST))
    assert count.settled
    assert "likely steps left out: 3" in count.note(0)
    assert "not connected for 5.0 s" in count.note(99 * S)


@pytest.mark.parametrize("state", [LinkState.LOST, LinkState.DISCONNECTED])
def test_a_device_lost_while_it_settles_is_settled_and_says_so(state):
    count = played(step(11))
    count.take(link(21, state))
    assert count.settled
    assert f"{state.value} before the last steps" in count.note(0)


def test_another_primary_counts_on_and_its_steps_are_in_the_trial():
    count = begun_at()
    for notice in (
        step(11),
        told(12, Segmented(primary="d", steps=1)),
        *map(step, (13, 14, 15)),
        step(16, counter="d"),
    ):
        count.take(notice)
    assert count.steps == 2
    ended(count, 20)
    count.take(told(21, Segmented(primary="e", steps=2)))
    assert count.settled
    assert count.note(0).count("counter changed") == 2


def test_remarks_of_the_end_are_part_of_the_note():
    assert "the clock was set" in played(remarks=("the clock was set",)).note(0)


@given(
    st.lists(
        st.one_of(
            st.builds(step, st.floats(0, 60)),
            st.builds(counting, st.floats(0, 60), st.integers(0, 9)),
            st.builds(gap, st.floats(5, 60), st.floats(0.1, 5), filled=st.booleans()),
            st.builds(link, st.floats(0, 60), st.sampled_from(LinkState)),
            st.builds(lambda at_s: told(at_s, Rebooted(boot=2, previous=1)), st.floats(0, 60)),
            st.builds(lambda at_s: told(at_s, Segmented(primary="c", steps=0)), st.floats(0, 60)),
            st.just("end"),
        ),
        max_size=40,
    )
)
def test_whatever_comes_a_count_never_falls_and_a_settled_one_never_changes(events):
    trial = Trial([Entry(device="a", counter="c")], number=1, name="any", began_ns=10 * S)
    count, counts, final = trial.counts["a"], [0], None
    for event in events:
        if event != "end":
            trial.take("a", event)
        elif trial.state is State.WALKING:
            trial.finish(30 * S, {"a": Finish(latency_s=3)})
        counts.append(count.steps)
        assert count.steps_now >= count.steps
        assert (trial.state is State.DONE) == count.settled
        if count.settled:
            final = final or (count.steps, count.note(0))
            assert (count.steps, count.note(0)) == final
    assert counts == sorted(counts)


@given(st.sampled_from(State), st.sampled_from(Cause))
def test_a_trial_goes_one_way(state, cause):
    order = list(State)
    try:
        assert order.index(advance(state, cause)) == order.index(state) + 1
    except NotNowError as error:
        assert state.value in str(error)
        assert cause.value in str(error)


# The true number


def done_trial(steps, true_steps, *, name="slow", number=1):
    devices = [f"A{i}" for i in range(len(steps))]
    entries = [Entry(device=device, counter="c", wrist="left") for device in devices]
    trial = Trial(entries, number=number, name=name, began_ns=10 * S)
    for device, n in zip(devices, steps, strict=True):
        for _ in range(n):
            trial.take(device, step(11))
    trial.finish(20 * S, dict.fromkeys(devices, Finish(latency_s=0)))
    for device in devices:
        trial.take(device, counting(20))
    trial.true_steps = true_steps
    return trial


def test_error_and_accuracy_are_those_of_table_4():
    """The paper's first rows: 200 steps, of which 165 and 177 were counted."""
    trial = done_trial([165, 177], 200)
    a10, mi = trial.counts.values()
    assert (trial.error(a10), trial.accuracy_percent(a10)) == (-35, 82.5)
    assert (trial.error(mi), trial.accuracy_percent(mi)) == (-23, 88.5)
    over = done_trial([242], 200)
    assert over.accuracy_percent(over.counts["A0"]) == 79.0


@pytest.mark.parametrize(("true_steps", "error"), [(None, None), (0, 3)])
def test_no_true_steps_have_no_accuracy(true_steps, error):
    trial = done_trial([3], true_steps)
    assert trial.error(trial.counts["A0"]) == error
    assert trial.accuracy_percent(trial.counts["A0"]) is None


def test_nothing_is_told_before_it_is_done():
    trial = Trial([Entry(device="a", counter="c")], number=1, name="any", began_ns=0)
    trial.true_steps = 100
    assert trial.error(trial.counts["a"]) is None


def test_a_mean_of_something_unknown_is_unknown():
    assert mean([1, 2]) == 1.5
    assert mean([1, None]) is None
    assert mean([]) is None


# The table


def rows_of(trials):
    return list(csv.DictReader(io.StringIO(table_csv(trials))))


def test_the_table_has_a_line_a_device_and_the_means_at_the_end():
    trials = [done_trial([165, 177], 200, number=1), done_trial([147, 77], 207, name="=cmd()", number=2)]
    walking = Trial([Entry(device="A0", counter="c")], number=3, name="not yet", began_ns=0)
    rows = rows_of([*trials, walking])
    assert tuple(rows[0]) == COLUMNS
    assert [(row["device"], row["counted steps"], row["error (steps)"]) for row in rows[:4]] == [
        ("A0", "165", "-35"),
        ("A1", "177", "-23"),
        ("A0", "147", "-60"),
        ("A1", "77", "-130"),
    ]
    assert (rows[0]["accuracy (%)"], rows[3]["accuracy (%)"]) == ("82.50", "37.20")
    assert rows[2]["test item"] == "'=cmd()"
    first, second = rows[4:]
    assert (first["device"], first["test item"], first["counted steps"]) == ("A0", "mean", "156.00")
    assert float(first["accuracy (%)"]) == pytest.approx((82.5 + 100 * 147 / 207) / 2, abs=0.005)
    assert second["error (steps)"] == "-76.50"


def test_a_trial_without_a_true_number_is_in_the_table_and_in_no_mean():
    rows = rows_of([done_trial([165], 200), done_trial([10], None)])
    assert (rows[1]["true steps"], rows[1]["error (steps)"], rows[1]["accuracy (%)"]) == ("", "", "")
    assert rows[2]["accuracy (%)"] == "82.50"
    assert rows[2]["note"] == "over 1 of 2 trials"
    assert table_csv([]).splitlines() == [",".join(COLUMNS)]


# Over devices


class Lab:
    """Two stands that walk at the same time, and trials whose clock is theirs."""

    def __init__(self, schedule="rest:12,normal:30,rest:60", **options):
        self.stands = [Stand(schedule, device_id=f"sim-{n}", seed=n, **options) for n in (1, 2)]
        self.devices = [stand.device for stand in self.stands]
        self.set_ns = 0
        self.trials = Trials(lambda: self.now_ns + self.set_ns, lambda: self.now_ns)

    @property
    def now_ns(self):
        return self.stands[0].now_ns

    def walk(self, seconds):
        for stand in self.stands:
            stand.walk(seconds)

    def begin(self):
        return self.trials.begin(self.devices, name=None, wrists={"sim-1": "left", "sim-2:address": "right"})


def test_two_wrists_count_one_walk():
    lab = Lab()
    lab.walk(8)
    trial = lab.begin()
    assert trial.name == "trial 1"
    lab.walk(40)
    lab.trials.finish(trial.number)
    assert trial.state is State.SETTLING
    lab.walk(10)
    assert trial.state is State.DONE
    for stand, count in zip(lab.stands, trial.counts.values(), strict=True):
        assert count.steps == pytest.approx(stand.true_steps, abs=3)
        assert count.steps == stand.device.session.tracker.total
        assert count.note(0) is None
        assert stand.device.session.observers == []
    assert [count.entry.wrist for count in trial.counts.values()] == ["left", "right"]


def test_an_end_in_the_middle_of_a_walk_parts_the_steps_by_their_time():
    lab = Lab("normal:60")
    lab.walk(10)
    trial = lab.begin()
    lab.walk(20)
    lab.trials.finish(trial.number)
    lab.walk(15)
    assert trial.state is State.DONE
    for stand, count in zip(lab.stands, trial.counts.values(), strict=True):
        times = [at_s for at_s in stand.walker.step_times_until(60) if 10 <= at_s <= 30]
        assert count.steps == pytest.approx(len(times), abs=2)
        assert trial.began_ns == START_NS + 10 * S


def test_a_reboot_in_a_trial_is_noted_and_costs_no_steps_of_the_first_boot():
    """Steps that were being decided when it started again keep the time at which they happened."""
    lab = Lab("normal:60")
    lab.walk(20)
    trial = lab.begin()
    lab.walk(10)
    first = lab.stands[0]
    first.bracelet.reset()
    lab.walk(10)
    lab.trials.finish(trial.number)
    lab.walk(15)
    hurt, whole = trial.counts.values()
    assert "started again" in hurt.note(0)
    assert whole.note(0) is None
    assert hurt.steps == pytest.approx(whole.steps, abs=4)
    steps = [notice for notice in first.told if isinstance(notice.event, StepCounted)]
    assert all(START_NS <= notice.at_ns <= lab.now_ns for notice in steps)


def test_a_device_lost_at_the_end_does_not_hold_up_the_trial():
    lab = Lab("normal:60")
    lab.walk(5)
    trial = lab.begin()
    lab.walk(10)
    lab.stands[1].lose()
    lab.trials.finish(trial.number)
    lab.walk(10)
    assert trial.state is State.DONE
    assert "not connected at the end" in trial.counts["sim-2"].note(0)


def test_a_clock_that_was_set_is_noted():
    lab = Lab("normal:60")
    trial = lab.begin()
    lab.walk(5)
    lab.set_ns = 3 * S
    lab.trials.finish(trial.number)
    assert "set by 3.0 s" in trial.counts["sim-1"].note(0)


def test_a_trial_is_begun_only_where_it_can_be_counted(monkeypatch):
    lab = Lab("normal:60")
    with pytest.raises(ParameterError, match="different"):
        lab.trials.begin([lab.devices[0], lab.devices[0]], name=None, wrists={})
    trial = lab.begin()
    with pytest.raises(NotNowError, match="trial 1"):
        lab.begin()
    lab.trials.finish(trial.number)
    assert lab.begin().number == 2  # the first one settles meanwhile
    lab.trials.delete(2)
    monkeypatch.setattr(trials_module, "KEPT", 1)
    with pytest.raises(NotNowError, match="delete"):
        lab.begin()
    lab.stands[1].lose()
    with pytest.raises(NotNowError, match="sim-2 is lost"):
        lab.begin()


def test_a_counter_that_cannot_count_is_refused_and_one_that_comes_later_is_noted():
    lab = Lab("normal:60")
    trial = lab.begin()
    first = lab.devices[0]
    first.lineup = lineup("gyro_zero_crossing")
    first.session.change_counters(first.lineup)  # as if nobody knew yet what the device sends
    lab.walk(2)
    lab.trials.finish(trial.number)
    assert "gyroscope" in trial.counts["sim-1"].note(0)
    with pytest.raises(NotNowError, match="sim-1 counts nothing"):
        lab.begin()


def test_a_deleted_trial_listens_no_more_and_is_unknown():
    lab = Lab("normal:60")
    trial = lab.begin()
    lab.trials.delete(trial.number)
    assert [stand.device.session.observers for stand in lab.stands] == [[], []]
    with pytest.raises(UnknownNumberError, match="/api/v1/trials"):
        lab.trials.get(trial.number)


def test_it_ends_only_once():
    lab = Lab("normal:60")
    trial = lab.begin()
    lab.trials.finish(trial.number)
    with pytest.raises(NotNowError, match="settling"):
        lab.trials.finish(trial.number)
    lab.walk(12)
    with pytest.raises(NotNowError, match="done"):
        lab.trials.finish(trial.number)
