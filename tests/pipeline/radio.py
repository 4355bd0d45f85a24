"""The supervisor over real GATT: bracelets on a virtual air, and what it did about them, without HTTP."""

import asyncio
import contextlib
from dataclasses import dataclass, field

from device_sim.air import LocalAir
from device_sim.bracelet import Bracelet
from device_sim.central import Central
from device_sim.gait import Walker
from service.links.ble import Backend
from service.pipeline.hub import Hub
from service.pipeline.lifecycle import Patience
from service.pipeline.lineup import lineup
from service.pipeline.supervisor import Supervisor
from service.wearables import bracelet as wire

QUICK = Patience(first_s=0.05, cap_s=0.2, healthy_s=1.0)


class Renamed(Bracelet):
    """A bracelet that tells the id `says`, while its address is made of `device_id`: it may change addresses."""

    def __init__(self, *args, says, **options):
        super().__init__(*args, **options)
        self.says = says

    def device_id_value(self):
        return wire.encode_device_id(self.says)


def walking(device_id="sim-1", *, says=None, seconds=600):
    return Renamed(Walker(f"normal:{seconds}", seed=1), says=says or device_id, device_id=device_id)


@dataclass
class Radio:
    """What a test may touch; `told` are all notices in order, and `observers` are called with each."""

    air: LocalAir
    central: Central
    backend: Backend
    supervisor: Supervisor
    told: list = field(default_factory=list)
    observers: list = field(default_factory=list)

    def hear(self, notice):
        self.told.append(notice)
        for observe in self.observers:
            observe(notice)

    async def until(self, holds, *, within_s=10.0):
        """Wait until `holds()`; return what it returned."""
        async with asyncio.timeout(within_s):
            while not (result := holds()):  # noqa: ASYNC110  # what is waited for has no event
                await asyncio.sleep(0.005)
        return result

    async def streams(self, key="sim-1", *, beyond=0, within_s=10.0):
        """Wait until the device of that id streams, and has more samples than `beyond`; return it."""

        def found():
            for device in self.supervisor.devices:
                if device.id == key and device.state == "streaming" and device.session.tracker.tally.samples > beyond:
                    return device
            return None

        return await self.until(found, within_s=within_s)


@contextlib.asynccontextmanager
async def on_radio(*, remembered=(), wanted=None, make_backend=None, patience=QUICK, **options):
    """A supervisor that runs on a local air with nobody on it yet."""
    async with LocalAir() as air, air.central() as central:
        backend = Backend(scanner=central.scanner, client=central.client)
        backend = make_backend(backend) if make_backend else backend
        hub = Hub(durable_limit=100_000)
        supervisor = Supervisor(
            hub=hub,
            make_wearable=wire.Bracelet,
            lineup=lineup("double_threshold"),
            wanted=wanted,
            backend=backend,
            patience=patience,
            **options,
        )
        for device in remembered:
            supervisor.remember(device)
        radio = Radio(air, central.central, backend, supervisor)
        publish = hub.publish
        hub.publish = lambda notice: (radio.hear(notice), publish(notice))
        async with supervisor.running():
            yield radio
        assert all(device.task is None or device.task.done() for device in supervisor.devices)
