"""Chunks of a second, whatever the size of the packets."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from store import made

from service.errors import ParameterError
from service.samples import TICK_EVERY, RawBlock
from service.store.chunker import Chunker, by_stretch, chunk_samples, counts
from service.store.values import Layout

INTEGERS = st.integers(-32768, 32767)


def blocks(cuts, *, run=0, gyro=False):
    """The made signal's blocks between consecutive cuts, each with the tick of the stretch it begins in."""
    for first, end in itertools.pairwise(cuts):
        acc = np.frombuffer(made.column(first, end, 31 * run), dtype="<i2").reshape(-1, 3).T / 4096.0
        columns = tuple(axis.tolist() for axis in acc)
        yield RawBlock(
            boot=7,
            index=first,
            tick=made.tick(first // TICK_EVERY),
            acc_g=columns,
            gyro_rad_s=columns if gyro else None,
        )


def chunked(parts, layout=made.LAYOUT):
    chunker = Chunker()
    chunks = [chunk for block in parts for chunk in chunker.add(block, run=0, layout=layout, at_ns=made.SINCE_NS)]
    return chunks + chunker.begun()


@settings(max_examples=30)
@given(st.sets(st.integers(1, 999), max_size=40), st.sampled_from([12.5, 25.0, 50.0, 100.0, 400.0]))
def test_packets_of_any_size_give_the_same_chunks(cuts, rate_hz):
    layout = dataclasses.replace(made.LAYOUT, rate_hz=rate_hz)
    every_stretch = {*cuts, *range(0, 1000, 64)}  # no block begins before a stretch and ends after it unseen
    found = chunked(blocks(sorted({0, 1000} | every_stretch)), layout)
    assert found == chunked(blocks([*range(0, 1000, 2), 1000]), layout)
    assert b"".join(chunk.acc for chunk in found) == made.column(0, 1000)
    assert {len(chunk) for chunk in found[:-1]} == {chunk_samples(rate_hz)}


def test_every_stretch_keeps_its_tick():
    found = chunked(blocks(range(0, 1001, 10)))
    ticks = {}
    for chunk in found:
        for k, tick in enumerate(chunk.ticks):
            ticks.setdefault(chunk.index // TICK_EVERY + k, set()).add(tick)
    # The stretch that begins inside of a chunk is known from the next block on.
    assert {stretch: {tick for tick in known if tick is not None} for stretch, known in ticks.items()} == {
        stretch: {made.tick(stretch)} for stretch in range(8)
    }


def test_pieces_have_the_tick_of_the_stretch_they_begin_in():
    whole = dataclasses.replace(made.chunk(100, 228), ticks=(made.tick(0), made.tick(1)))
    assert list(by_stretch(whole)) == [made.chunk(100, 128), made.chunk(128, 228)]
    unknown = dataclasses.replace(whole, ticks=(made.tick(0), None))
    assert list(by_stretch(unknown)) == [unknown]


def test_nothing_is_joined_over_a_hole():
    found = chunked([*blocks([0, 10, 20]), *blocks([30, 50, 60])])
    assert sorted((chunk.index, chunk.end) for chunk in found) == [(0, 20), (30, 50), (50, 60)]


def test_live_samples_and_history_in_turns_give_whole_chunks():
    turns = zip(blocks(range(1000, 1401, 8)), blocks(range(0, 401, 8)), strict=True)
    found = chunked(block for both in turns for block in both)
    assert sorted((chunk.index, chunk.end) for chunk in found) == [
        (first + k, first + k + 50) for first in (0, 1000) for k in range(0, 400, 50)
    ]


def test_what_has_begun_is_told_when_it_has_grown_and_goes_on():
    chunker = Chunker()
    parts = [*blocks([0, 10, 20, 50])]
    told = []
    for part in parts:
        told += chunker.add(part, run=0, layout=made.LAYOUT, at_ns=made.SINCE_NS)
        told += chunker.begun()
        assert chunker.begun() == []
    assert [(chunk.index, chunk.end) for chunk in told] == [(0, 10), (0, 20), (0, 50)]


def test_another_run_layout_or_sensor_is_another_chunk():
    chunker = Chunker()
    (first,) = blocks([0, 10])
    (second,) = blocks([10, 20], gyro=True)
    other = Layout(rate_hz=50.0, lsb_per_g=2048.0, lsb_per_rad_s=1000.0)
    assert chunker.add(first, run=0, layout=made.LAYOUT, at_ns=1) == []
    assert chunker.add(first, run=1, layout=made.LAYOUT, at_ns=2) == []
    (ended,) = chunker.add(second, run=1, layout=other, at_ns=3)
    assert (ended.run, len(ended), ended.at_ns) == (0, 10, 1)
    before, last = chunker.begun()
    assert (before.run, before.gyro, before.at_ns) == (1, None, 2)
    assert np.frombuffer(last.gyro, "<i2")[0] == round(second.gyro_rad_s[0][0] * 1000)


@given(st.lists(st.tuples(INTEGERS, INTEGERS, INTEGERS), min_size=1, max_size=50), st.integers(1, 65535))
def test_integers_come_back_from_g(samples, lsb):
    columns = tuple([value / lsb for value in axis] for axis in zip(*samples, strict=True))
    assert np.frombuffer(counts(columns, float(lsb)), "<i2").reshape(-1, 3).tolist() == [list(xyz) for xyz in samples]


@pytest.mark.parametrize("value", [9.0, float("nan"), float("-inf")])
def test_what_is_no_integer_of_16_bits_is_refused(value):
    with pytest.raises(ParameterError, match="16 bits"):
        counts(([value], [0.0], [0.0]), 4096.0)


@pytest.mark.parametrize(
    "wrong",
    [{"acc": b"12345"}, {"acc": b""}, {"ticks": (1, 2)}, {"gyro": b"123456"}, {"acc": bytes(6 * 129), "ticks": (1, 2)}],
    ids=["half a sample", "none", "ticks", "sensors of different length", "too long"],
)
def test_a_chunk_that_contradicts_itself_is_refused(wrong):
    with pytest.raises(ParameterError):
        dataclasses.replace(made.chunk(0, 50), **wrong)
