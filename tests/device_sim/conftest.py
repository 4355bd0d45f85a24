"""Airs of both kinds, a source with known samples, and a host that decodes what it is sent."""

import asyncio
import contextlib

import numpy as np
import pytest
from bleak import BleakClient, BleakScanner

from device_sim.air import LocalAir
from device_sim.air_tcp import AirServer, RemoteAir
from device_sim.bracelet import Bracelet
from service.samples import ACCELEROMETER_ONLY, RawBlock, Reply
from service.wearables import bracelet as wire
from service.wearables import bracelet_control as control


class Known:
    """A finite source of n random samples within ±4 g, the same for the same seed."""

    sensors = ACCELEROMETER_ONLY

    def __init__(self, n, *, rate_hz=50.0, seed=0):
        self.rate_hz = rate_hz
        self.acc_g = np.random.default_rng(seed).uniform(-4, 4, (n, 3))
        self.next = 0

    def read(self, n):
        block = self.acc_g[self.next : self.next + n]
        self.next += len(block)
        return block

    def true_steps_until(self, _t_s):
        return None


class Endless(Known):
    """One second of samples over and over."""

    def __init__(self, **options):
        super().__init__(50, **options)

    def read(self, n):
        index = np.arange(self.next, self.next + n) % len(self.acc_g)
        self.next += n
        return self.acc_g[index]


async def until(condition, *, within_s=5.0, every_s=0.002):
    """Wait until `condition()` holds; with `every_s` 0 it is asked in each turn of the loop."""
    async with asyncio.timeout(within_s):
        while not condition():  # noqa: ASYNC110  # what is waited for has no event
            await asyncio.sleep(every_s)


class Host:
    """A bleak client with the bracelet's decoder: what it read and the blocks it was notified of."""

    def __init__(self, client):
        self.client = client
        self.decoder = wire.Bracelet()
        self.blocks = []
        self.again = []
        self.replies = []
        self.gone = 0

    @classmethod
    async def connect(cls, central, *, device=None, timeout=5.0, **options):  # noqa: ASYNC109
        device = device or await seen(central)
        host = cls(None)
        host.central = central
        host.client = BleakClient(device, host._on_gone, backend=central.client, timeout=timeout, **options)
        await host.client.connect()
        return host

    def _on_gone(self, _client):
        self.gone += 1

    async def describe(self):
        infos = {}
        for action in self.decoder.handshake():
            absent = self.client.services.get_characteristic(action.characteristic) is None
            if type(action).__name__ == "Read" and not (action.optional and absent):
                data = bytes(await self.client.read_gatt_char(action.characteristic))
                infos[action.characteristic] = self.decoder.feed(action.characteristic, data)
        return infos

    async def subscribe(self):
        await self.describe()
        await self.listen()

    async def listen(self):
        """Subscribe and begin, as the handshake has it; a bracelet without a control point begins by itself."""
        await self.client.start_notify(wire.DATA, self._take)
        if self.client.services.get_characteristic(wire.CONTROL) is not None:
            await self.enable_answers()
            assert (await self.ask(control.start())).accepted

    async def enable_answers(self):
        await self.client.start_notify(wire.CONTROL, self._take)

    async def ask(self, write, *, within_s=5.0):
        """Write a request and return its answer."""
        before = len(self.replies)
        await self.client.write_gatt_char(write.characteristic, write.data, response=True)
        await self.until(lambda: len(self.replies) > before, within_s=within_s)
        return self.replies[-1]

    def _take(self, characteristic, data):
        said = self.decoder.feed(characteristic.uuid, bytes(data))
        if isinstance(said, Reply):
            self.replies.append(said)
            return
        assert isinstance(said, RawBlock)
        (self.again if said.history else self.blocks).append(said)

    @property
    def samples(self):
        return sum(len(block) for block in self.blocks)

    def acc_g(self):
        return np.concatenate([np.transpose(block.acc_g) for block in self.blocks])

    async def until(self, condition, *, within_s=5.0):
        await until(condition, within_s=within_s)

    async def got(self, samples, **options):
        await self.until(lambda: self.samples >= samples, **options)


async def seen(central, name="Steplink"):
    """The device of that name, as a scan for the bracelet's service finds it."""
    found = await BleakScanner.find_device_by_filter(
        lambda _device, data: data.local_name == name and wire.SERVICE in data.service_uuids,
        timeout=5.0,
        service_uuids=[wire.SERVICE],
        backend=central.scanner,
    )
    assert found is not None, f"{name} does not advertise"
    return found


@contextlib.asynccontextmanager
async def airs(kind):
    async with LocalAir() as local:
        if kind == "local":
            yield local
            return
        async with AirServer(local) as server:
            yield RemoteAir(server.address)


@pytest.fixture(params=["local", "tcp"])
def on_air(request):
    """A function: an async context of (bracelet, central) on an air of each kind."""

    @contextlib.asynccontextmanager
    async def stage(source=None, *, packet_samples=10, speed=1.0, **radio):
        bracelet = Bracelet(source or Endless(), packet_samples=packet_samples)
        async with (
            airs(request.param) as air,
            air.bracelet(bracelet, speed=speed, **radio) as gatt,
            air.central() as central,
        ):
            yield gatt, central

    stage.air = lambda: airs(request.param)
    return stage


@pytest.fixture
def radio():
    """The helpers above, for tests that make their own air."""
    namespace = type("radio", (), {})
    namespace.Known, namespace.Endless, namespace.Host = Known, Endless, Host
    namespace.seen, namespace.until = staticmethod(seen), staticmethod(until)
    return namespace


@pytest.fixture(autouse=True)
async def nothing_left_running():
    """No task outlives a test's contexts."""
    before = asyncio.all_tasks()
    yield
    leaked = asyncio.all_tasks() - before - {asyncio.current_task()}
    if leaked:
        _, leaked = await asyncio.wait(leaked, timeout=0.5)
    assert not leaked
