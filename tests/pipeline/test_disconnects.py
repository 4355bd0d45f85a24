"""Disconnects at any moment: subscribed again each time, each notification counted once, nothing left behind."""

import asyncio
import contextlib
import random
import statistics
import time

import psutil
import pytest
from links.air import at_each_step
from pipeline.radio import QUICK, on_radio, walking

from service.pipeline.lifecycle import Patience, State
from service.pipeline.notices import StateChanged

MOMENTS = ("connect", "discovery", "subscribe", "streaming")
"""When a link may be lost. A bracelet that sends its history again adds one more, told to `Losses.comes`."""
RECONNECT_S = 2.0
"""Median, beside the back-off."""
IN_FLIGHT_PACKETS = 3
"""What a bracelet may have given to the radio when a link is lost."""


class Losses:
    """Loses the link at each moment of `plan` in turn; a turn of streaming lasts up to `streaming_s`."""

    def __init__(self, plan, gatt, rng, streaming_s):
        self.plan = list(plan)
        self.done = []
        self._gatt = gatt
        self._rng = rng
        self._streaming_s = streaming_s
        self._dropping = set()

    async def comes(self, step):
        if self.plan and self.plan[0] == step:
            self._begin(self._drop(step))

    async def stream(self):
        """Lose the link while it streams, when that is the plan's next."""
        if self.plan and self.plan[0] == "streaming":
            await asyncio.sleep(self._rng.uniform(0, self._streaming_s))
            await self._drop("streaming")

    async def _drop(self, moment):
        while not self._gatt.connected:  # noqa: ASYNC110  # the bracelet tells nobody
            await asyncio.sleep(0)
        for _ in range(self._rng.randrange(12)):
            await asyncio.sleep(0)
        if self.plan and self.plan[0] == moment and self._gatt.connected:
            self.done.append(self.plan.pop(0))
            await self._gatt.drop_link()

    def _begin(self, drop):
        task = asyncio.create_task(drop)
        self._dropping.add(task)
        task.add_done_callback(self._dropping.discard)


class Returns:
    """How long each way back took, beside the back-off."""

    def __init__(self, radio):
        self.took_s = []
        self._supervisor = radio.supervisor
        radio.observers.append(self._heard)

    def _heard(self, notice):
        if isinstance(notice.event, StateChanged) and notice.event.state is State.STREAMING:
            (device,) = self._supervisor.devices
            if device.not_before_s:
                self.took_s.append(time.monotonic() - device.not_before_s)


async def storm(disconnects, *, seed, patience, streaming_s):
    rng = random.Random(seed)
    plan = [MOMENTS[n % len(MOMENTS)] for n in range(disconnects)]
    rng.shuffle(plan)
    losses = None

    async def comes(step):
        if losses is not None:
            await losses.comes(step)

    async with contextlib.AsyncExitStack() as stack:
        seen = []

        def make_backend(inner):
            return at_each_step(inner, LateBound(seen), comes)

        radio = await stack.enter_async_context(on_radio(make_backend=make_backend, patience=patience))
        gatt = await stack.enter_async_context(radio.air.bracelet(walking(seconds=6000), speed=8.0))
        seen.append(gatt)
        device = await radio.streams(beyond=50)
        before, returns = footprint(radio), Returns(radio)
        losses = Losses(plan, gatt, rng, streaming_s)
        while losses.plan:
            if losses.plan[0] != "streaming" and device.state is State.STREAMING:
                losses.plan.insert(0, "streaming")  # there is a way to set-up through a loss only
            samples = device.session.tracker.tally.samples
            if losses.plan[0] == "streaming":
                await radio.streams(beyond=samples, within_s=60)
                await losses.stream()
            await asyncio.sleep(0.005)
        tally = device.session.tracker.tally
        await radio.streams(beyond=tally.samples + 50, within_s=60)
        assert radio.supervisor.devices == [device]
        await radio.until(lambda: device.session.tracker.tally.samples_awaited == 0)
        tally = device.session.tracker.tally
        assert tally.packets_bad == tally.reboots == 0
        assert tally.samples_lost == tally.gaps == 0  # what was measured while it was away has been sent again
        sent = gatt.statistics()
        unheard = sent.packets + sent.packets_again - tally.packets
        assert 0 <= unheard <= IN_FLIGHT_PACKETS * len(losses.done)
        assert len(losses.done) >= disconnects
        assert {moment: losses.done.count(moment) for moment in MOMENTS}.keys() == set(losses.done)
        await radio.until(lambda: footprint(radio) == before)
    assert len(returns.took_s) >= losses.done.count("streaming")
    assert statistics.median(returns.took_s) <= RECONNECT_S
    return losses, returns


class LateBound:
    """The bracelet, once it is there."""

    def __init__(self, seen):
        self._seen = seen

    def __getattr__(self, name):
        return getattr(self._seen[0], name)


def footprint(radio):
    """What must not grow: tasks by name, open files, and the radio's own."""
    tasks = sorted(task.get_name() for task in asyncio.all_tasks() if not task.get_name().startswith("Task-"))
    unnamed = sum(task.get_name().startswith("Task-") for task in asyncio.all_tasks())
    return tasks, unnamed, psutil.Process().num_fds(), radio.central.statistics()


@pytest.mark.full
@pytest.mark.parametrize("seed", [1, 2])
async def test_disconnects_at_any_moment(seed):
    await storm(24, seed=seed, patience=QUICK, streaming_s=0.5)


@pytest.mark.soak
async def test_a_hundred_disconnects_in_ten_minutes():
    began = time.monotonic()
    await storm(100, seed=9, patience=Patience(cap_s=4.0, healthy_s=2.0), streaming_s=10.0)
    assert time.monotonic() - began < 600
