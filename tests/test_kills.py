"""Killed with -9 at any moment, service, air or bracelet: what is stored equals what an undisturbed run counts.

Every part is a process of its own and the database a real file. The bracelet plays several device seconds a second; the
truth is counted here, by the pure Tracker over the very same samples.
"""

import contextlib
import itertools
import random
import time

import numpy as np
import pytest
from processes import Parts
from undisturbed import LSB_PER_G, Played, Undisturbed

from service.events import StepCounted
from service.store import database
from service.store.reader import Reader
from service.store.values import LogQuery

COUNTERS = ("steplink", "double_threshold")
WALK = "normal:30,slow:20,rest:6,type:8,fast:20,run:15,rest:5,normal:45"
SEED = 7
SPEED = 8
"""A minute of outage are eight of the device's: the ten it keeps are enough."""
START_S, LIFE_S = 1.0, 2.5
"""A service is killed within the first while it starts, or within the second after it has found the bracelet.

So it is asking for what it missed, going on, or storing, which it does once a second. No outage is long, not even on a
busy machine.
"""
STARTING = 0.25
"""Share of those that are killed while they start."""
AWAY_S = 1.0
"""How long each part is away."""


class Stored:
    """What a database holds of the only session in it, checked to be whole; nothing else may have it open to write."""

    def __init__(self, path):
        with contextlib.closing(database.connect_reader(path)) as connection:
            reader = Reader(connection, path)
            reader.check()
            (session,) = reader.sessions()
            self.cursor = session.cursor
            self.raw = reader.raw(session.key)
            entries = reader.log(LogQuery(device=session.key.device, limit=10**6)).entries
        told = [entry.told for entry in entries]
        self.ordinals = [entry.ordinal for entry in entries]
        self.kinds = [getattr(one, "kind", "step") for one in told]
        self.steps = {name: [] for name in COUNTERS}
        for one in told:
            if isinstance(one, StepCounted):
                self.steps[one.counter].append((one.boot, one.steps, one.step))
        self.tallies = dict(session.steps)

    def check_samples(self, played):
        """Every stored sample is the one that was played."""
        for span in self.raw.spans:
            values = self.raw.values[span.row : span.row + span.samples]
            truth = played.counts(span.index, span.index + span.samples) / LSB_PER_G
            assert np.array_equal(values, truth), span

    def check_steps(self, truth):
        """Every step is stored, once, as it was counted by nobody disturbed."""
        assert "gap" not in self.kinds, "lost: was the outage longer than what the bracelet keeps?"
        assert self.ordinals == sorted(set(self.ordinals))
        for name in COUNTERS:
            assert [steps for _, steps, _ in self.steps[name]] == list(range(1, len(self.steps[name]) + 1))
            assert self.steps[name] == truth.steps[name], name
        assert self.tallies == {name: len(steps) for name, steps in truth.steps.items()}


def is_begun(path):
    """Whether something of a session is on the disk."""
    with contextlib.closing(database.connect_reader(path)) as connection:
        return any(session.cursor is not None for session in Reader(connection, path).sessions())


def live(parts, service, rng):
    """Run the service up to the next moment to kill it."""
    service.start()
    if rng.random() < STARTING:
        time.sleep(rng.uniform(0, START_S))
    else:
        parts.until(lambda device: device["state"] == "streaming", parts=(service,))
        time.sleep(rng.uniform(0, LIFE_S))
    service.check_runs()


def check_kills(parts, kills, seed):
    rng, played = random.Random(seed), Played(WALK, SEED)
    truth, recorded = Undisturbed(played, COUNTERS), []
    first = boot = None
    with parts.bracelet() as bracelet, parts.service() as service:
        parts.until(lambda device: device["steps"] > 10, parts=(bracelet, service))
        while not is_begun(parts.database):
            time.sleep(0.1)
        while len(recorded) < kills:
            service.kill()
            stored = Stored(parts.database)
            stored.check_samples(played)
            if first is None:
                first, boot = stored.raw.spans[0].index, stored.raw.spans[0].boot
            assert (stored.raw.spans[0].index, {span.boot for span in stored.raw.spans}) == (first, {boot})
            truth.count(boot, first, stored.cursor.index)
            stored.check_steps(truth)
            recorded.append(len(stored.raw.values))
            live(parts, service, rng)
            bracelet.check_runs()
        parts.until(lambda device: device["samples_awaited"] == 0 and device["state"] == "streaming")
        service.end()
    stored = Stored(parts.database)
    (span,) = stored.raw.spans
    assert (span.boot, span.index, span.index + span.samples) == (boot, first, stored.cursor.index)
    stored.check_samples(played)
    truth.count(boot, first, stored.cursor.index)
    stored.check_steps(truth)
    assert "reboot" not in stored.kinds
    grown = sum(after > before for before, after in itertools.pairwise(recorded))
    assert grown > kills / 10, "it was mostly killed before it stored anything"
    return {"grown": grown, "samples": span.samples, **stored.tallies}


@pytest.mark.full
def test_the_service_killed_25_times(tmp_path):
    check_kills(Parts(tmp_path, speed=SPEED, walk=WALK, seed=SEED, beside=COUNTERS[1:]), 25, seed=4)


@pytest.mark.soak
def test_the_service_killed_200_times(tmp_path):
    began_s = time.monotonic()
    seed = time.time_ns()
    print(f"seed {seed}")
    reached = check_kills(Parts(tmp_path, speed=SPEED, walk=WALK, seed=SEED, beside=COUNTERS[1:]), 200, seed=seed)
    print(f"200 kills in {time.monotonic() - began_s:.0f} s: {reached}")


@pytest.mark.full
def test_air_service_and_bracelet_killed_in_turn(tmp_path):
    """A bracelet that dies takes what it keeps along: before that all had come, and its new boot begins at sample 0."""
    parts = Parts(tmp_path, speed=SPEED, walk=WALK, seed=SEED, beside=COUNTERS[1:])
    with contextlib.ExitStack() as stack:
        air = stack.enter_context(parts.air_alone())
        air.until_said("open")  # else the bracelet serves the air
        bracelet, service = (stack.enter_context(part) for part in (parts.bracelet(), parts.service()))
        everybody = (air, bracelet, service)
        device = parts.goes_on({"samples": 0, "reboots": 0}, everybody)
        for killed in (air, service, bracelet, service):
            killed.kill()
            if killed is not service:
                parts.until(lambda device: device["state"] != "streaming")
            time.sleep(AWAY_S)
            killed.start()
            device = parts.goes_on({**device, "reboots": device["reboots"] + (killed is bracelet)}, everybody)
        service.end()
    stored, played = Stored(parts.database), Played(WALK, SEED)
    stored.check_samples(played)
    before, after = stored.raw.spans
    assert (after.index, after.index + after.samples) == (0, stored.cursor.index)
    truth = Undisturbed(played, COUNTERS)
    truth.count(before.boot, before.index, before.index + before.samples)
    truth.count(after.boot, after.index, stored.cursor.index)
    stored.check_steps(truth)
    assert stored.kinds.count("reboot") == truth.reboots == 1
    assert stored.kinds.count("correction") >= 2, "something was missing in each run, and came"
