"""Joined packets are stored as the packets themselves are."""

from hypothesis import given
from hypothesis import strategies as st

from service.events import Received
from service.samples import TICK_EVERY, RawBlock
from service.store.chunker import Chunker
from service.store.joined import joined
from service.store.values import Layout

LAYOUT = Layout(rate_hz=50.0, lsb_per_g=4096.0, lsb_per_rad_s=900.0)


def column(index, n, factor):
    return [factor * ((index + i) % 1000) / 4096 for i in range(n)]


def block(index, n, boot, *, gyro, tick):
    acc = tuple(column(index, n, factor) for factor in (1, 2, 3))
    turns = tuple([float((index + i) % 30) / 900 for i in range(n)] for _ in range(3))
    stretch = index // TICK_EVERY
    return RawBlock(
        boot=boot,
        index=index,
        tick=stretch * 37 % 65536 if tick else None,
        acc_g=acc,
        gyro_rad_s=turns if gyro else None,
        saturated=[n - 1] if n > 3 else [],
    )


PACKETS = st.lists(
    st.tuples(
        st.integers(1, 40), st.sampled_from([0, 0, 0, 0, 7, 300]), st.booleans(), st.sampled_from([True] * 9 + [False])
    ),
    max_size=60,
)


@given(packets=PACKETS, reboot_at=st.integers(0, 80))
def test_the_same_samples_and_ticks_are_stored(packets, reboot_at):
    arrived, index, run = [], 5, 0
    for k, (n, hole, gyro, tick) in enumerate(packets):
        if k == reboot_at:
            run, index = 1, 0
        index += hole
        arrived.append((Received(run=run, block=block(index, n, 1 + run, gyro=gyro and k > 30, tick=tick)), k))
        index += n
    assert stored(arrived) == stored(list(joined(arrived)))


def stored(arrived):
    chunker, made = Chunker(), []
    for told, at_ns in arrived:
        made += chunker.add(told.block, run=told.run, layout=LAYOUT, at_ns=at_ns)
    samples, ticks = {}, {}
    for chunk in made + chunker.begun():
        for i in range(len(chunk)):
            gyro = chunk.gyro and chunk.gyro[6 * i : 6 * i + 6]
            samples[chunk.run, chunk.index + i] = (chunk.boot, chunk.layout, chunk.acc[6 * i : 6 * i + 6], gyro)
        for k, tick in enumerate(chunk.ticks, chunk.index // TICK_EVERY):
            if tick is not None:
                ticks[chunk.run, k] = tick
    return samples, ticks


def test_what_goes_on_is_one_block_up_to_the_next_tick_and_keeps_what_is_saturated():
    arrived = [(Received(run=0, block=block(10 * k, 10, 1, gyro=True, tick=True)), k) for k in range(20)]
    made = list(joined(arrived))
    assert [(told.block.index, len(told.block)) for told, _ in made] == [(0, 130), (130, 70)]
    assert made[0][0].block.saturated == list(range(9, 130, 10))
