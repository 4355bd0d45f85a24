"""Any order of any batches, any number of times: the same store, which holds the union of them."""

import contextlib
import math
import sqlite3

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from store import made

from service.events import Heading, StepCounted
from service.samples import Step
from service.store import codec, database
from service.store.reader import Reader
from service.store.schema import MIGRATIONS
from service.store.scribe import Scribe
from service.store.values import Batch, LogEntry, LogQuery

KEY = made.session()
FLOATS = st.floats(allow_nan=False)
SPANS = st.tuples(st.integers(0, 1), st.integers(0, 300), st.integers(1, 100))


@contextlib.contextmanager
def memory():
    with contextlib.closing(sqlite3.connect(":memory:", isolation_level=None)) as connection:
        for statements in MIGRATIONS:
            for statement in statements:
                connection.execute(statement)
        yield Scribe(connection, set()), Reader(connection, None)


def written(scribe, batches):
    for batch in batches:
        with database.transaction(scribe.connection):
            scribe.write(batch)


@settings(max_examples=40)
@given(st.lists(SPANS, min_size=1, max_size=12), st.randoms(use_true_random=False))
def test_chunks_in_any_order_give_every_sample_once(spans, random):
    batches = [
        Batch(session=KEY, chunks=(made.chunk(first, first + n, run=run),), cursor=made.cursor(first, run))
        for run, first, n in spans
    ]
    places = sorted({(run, index) for run, first, n in spans for index in range(first, first + n)})
    with memory() as (scribe, reader):
        for _ in range(2):
            random.shuffle(batches)
            written(scribe, batches)
            raw = reader.raw(KEY)
            told = [(span.run, span.index + k) for span in raw.spans for k in range(span.samples)]
            assert told == places
            expected = b"".join(made.column(index, index + 1, 31 * run) for run, index in places)
            assert (raw.values * 4096).astype("<i2").tobytes() == expected
            assert b"".join(chunk.acc for chunk in reader.replay(KEY).items) == expected
            assert reader.resume()[0].cursor.place == max((run, first) for run, first, _ in spans)


@settings(max_examples=40)
@given(st.integers(0, 400), st.integers(1, 400), st.integers(1, 9))
def test_pages_of_any_size_from_anywhere_give_the_rest(start, stop, limit):
    chunks = [made.chunk(first, first + 37) for first in range(0, 400, 29)]
    with memory() as (scribe, reader):
        written(scribe, [Batch(session=KEY, chunks=chunks)])
        after, seen = made.cursor(start), []
        while after is not None:
            page = reader.replay(KEY, after, limit=limit)
            seen += page.items
            after = page.after
        assert b"".join(chunk.acc for chunk in seen) == made.column(start, max(start, 414))
        raw = reader.raw(KEY, start=made.cursor(start), stop=made.cursor(stop))
        assert (raw.values * 4096).astype("<i2").tobytes() == made.column(start, max(start, stop))


@settings(max_examples=40)
@given(
    st.builds(
        Step,
        at_s=st.floats(0, 1e9),
        strength=FLOATS,
        interval_s=st.none() | FLOATS,
        peak=st.none() | FLOATS,
        valley=st.none() | FLOATS,
        upper=st.none() | FLOATS,
        lower=st.none() | FLOATS,
    ),
    st.integers(0, 2**32 - 1),
    st.none() | st.builds(Heading, deg=FLOATS, uncertainty_deg=FLOATS, is_line=st.booleans()),
)
def test_a_step_comes_back_bit_for_bit(step, boot, heading):
    told = StepCounted(counter="fusion", boot=boot, steps=1, step=step, uncertainty_s=0.011, heading=heading)
    entry = LogEntry(ordinal=1, at_ns=made.SINCE_NS, uncertainty_s=0.1, run=3, told=told)
    with memory() as (scribe, reader):
        written(scribe, [Batch(session=KEY, entries=(entry,))] * 2)
        assert list(reader.log(LogQuery(device=KEY.device)).entries) == [entry]
        assert reader.sessions()[0].steps == {"fusion": 1}


def test_a_strength_that_is_no_number_stays_none():
    step = StepCounted(counter="fusion", boot=1, steps=1, step=Step(at_s=1.0, strength=math.nan))
    entry = LogEntry(ordinal=1, at_ns=1, uncertainty_s=0.0, run=0, told=step)
    with memory() as (scribe, reader):
        written(scribe, [Batch(session=KEY, entries=(entry,))] * 2)
        (found,) = reader.log(LogQuery(device=KEY.device)).entries
        assert math.isnan(found.told.step.strength)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**62), 2**62) | FLOATS | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@settings(max_examples=30)
@given(st.dictionaries(st.text(max_size=5), JSON, max_size=4))
def test_plain_data_come_back_as_they_were(state):
    assert codec.unpack_state(codec.pack_state(state)) == state


@given(st.lists(st.none() | st.integers(0, 65535), min_size=1, max_size=4))
def test_ticks_come_back_as_they_were(ticks):
    assert codec.unpack_ticks(codec.pack_ticks(ticks), len(ticks)) == tuple(ticks)


def test_changed_scales_are_kept_sample_by_sample():
    layouts = [made.LAYOUT, made.Layout(rate_hz=50.0, lsb_per_g=2048.0)]
    chunks = [made.chunk(50 * k, 50 * k + 50, layout=layouts[k % 2]) for k in range(4)]
    with memory() as (scribe, reader):
        written(scribe, [Batch(session=KEY, chunks=chunks)])
        raw = reader.raw(KEY)
    integers = np.frombuffer(made.column(0, 200), "<i2").reshape(-1, 3)
    assert np.array_equal(raw.values, integers / np.repeat([4096.0, 2048.0, 4096.0, 2048.0], 50)[:, None])
    assert [span.layout.lsb_per_g for span in raw.spans] == [4096.0, 2048.0, 4096.0, 2048.0]
