"""The bracelet on the air: measures as time passes, notifies whoever asked for it, and fails on request.

Time goes on whether anybody listens or not, and while the air is away; what nobody takes stays in the ring. Samples are
paced against the loop's clock, so nothing drifts but what the bracelet's own clock does: after a pause, what has fallen
due meanwhile is measured at once. Of samples that are sent again, one packet goes after all that is live.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from enum import StrEnum
from types import TracebackType
from typing import Final, Self

from bumble.transport.common import Transport

from device_sim.bracelet import Bracelet
from device_sim.controller import Air
from device_sim.pace import Pace
from device_sim.peripheral import DEFAULT_MTU, Peripheral, advertisement
from service.errors import LinkError, ParameterError
from service.wearables import rsc

REOPEN_S: Final = 0.5
"""How long a bracelet waits before it looks for a lost air again."""
REGISTER_EVERY: Final = 4
"""Steps after which the register is notified anew: about every two seconds of a walk."""
PACE_EVERY_S: Final = 1.0
"""How often running speed and cadence are told."""
MUTE_POLL_S: Final = 0.05
"""How often a silenced bracelet looks whether it may go on with a report."""
TURN_SAMPLES: Final = 5000
"""What is measured at once at most: a speed beyond the machine's lags, and does not block it."""


class Start(StrEnum):
    """When the source begins: at power-on as a real one, or with its first sample for the first subscriber."""

    POWER_ON = "power_on"
    ON_SUBSCRIBE = "on_subscribe"


@dataclass(frozen=True, slots=True, kw_only=True)
class GattStatistics:
    """Packets since power-on that a host took, live and sent again; links made; and what became of the samples."""

    packets: int
    packets_again: int
    links: int
    measured: int
    sent: int
    lost: int
    waiting: int
    saturated: int


class GattBracelet:
    """A bracelet that advertises and serves on an air while entered.

    `speed` is device seconds per second; `math.inf` plays as fast as the subscriber takes it, and stands still while
    there is none. `name` has at most 8 bytes, `max_mtu` is the largest ATT MTU agreed to (23…517). `played` is set once
    a finite source has been played to its end. `distort` maps an outgoing live packet to those that are sent instead:
    none loses it, as a firmware does whose queue is full, two duplicate it. A report waits for the radio. An
    `encrypted` one wants to be paired with; keys are exchanged and compared, but the virtual radio ciphers nothing.
    """

    def __init__(
        self,
        bracelet: Bracelet,
        air: Air,
        *,
        name: str = "Steplink",
        speed: float = 1.0,
        start: Start = Start.POWER_ON,
        max_mtu: int = 517,
        encrypted: bool = False,
    ) -> None:
        if not speed > 0:
            raise ParameterError("speed", speed, "above 0, or inf")
        if not DEFAULT_MTU <= max_mtu <= 517:
            raise ParameterError("max_mtu", max_mtu, "23 to 517 bytes")
        advertisement(name)  # raises here rather than on the air
        self.bracelet = bracelet
        self.played = asyncio.Event()
        self.distort: Callable[[bytes], Iterable[bytes]] | None = None
        self._air = air
        self._name = name
        self._speed = speed
        self._start = Start(start)
        self._max_mtu = max_mtu
        self._encrypted = encrypted
        self._peripheral: Peripheral | None = None
        self._away = self._muted = False
        self._corrupt = 0
        self._packets = self._packets_again = 0
        self._links_before = 0
        self._listened = asyncio.Event()
        """Set when a host begins to take live samples."""
        self._asked = asyncio.Event()
        """Set while a host may wait for a report."""
        self._attached = asyncio.Event()
        self._charged = asyncio.Event()
        self._charged.set()
        self._told = (bracelet.battery.percent, 0)
        """Charge and step register that subscribers know."""
        self._pace, self._paced_s = Pace(), 0.0
        self._task: asyncio.Task[None] | None = None

    async def __aenter__(self) -> Self:
        self._task = asyncio.create_task(self._run(), name=f"bracelet {self.bracelet.device_id}")
        attached = asyncio.ensure_future(self._attached.wait())
        try:
            await asyncio.wait({self._task, attached}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            attached.cancel()
            if not self._attached.is_set():
                await self._stop()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self._stop()

    @property
    def connected(self) -> bool:
        """Whether a host is linked."""
        return self._peripheral is not None and self._peripheral.link is not None

    @property
    def subscribed(self) -> bool:
        """Whether a host takes data (and the bracelet is not silenced)."""
        return self._peripheral is not None and self._peripheral.listening

    def statistics(self) -> GattStatistics:
        """Return counts since power-on."""
        links = self._links_before + (self._peripheral.links_made if self._peripheral else 0)
        return GattStatistics(
            packets=self._packets, packets_again=self._packets_again, links=links, **asdict(self.bracelet.statistics())
        )

    async def until_played(self) -> None:
        """Wait until a finite source has been played; raise what ended the bracelet before that."""
        if self._task is None:
            raise RuntimeError("the bracelet is not on the air")
        played = asyncio.ensure_future(self.played.wait())
        try:
            await asyncio.wait({self._task, played}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            played.cancel()
        if not self.played.is_set() and not self._task.cancelled() and (error := self._task.exception()) is not None:
            raise _first(error)

    async def set_battery(self, percent: int) -> None:
        """Set the charge (0…100 %) and notify it; one that was flat starts again."""
        self.bracelet.battery.charge(percent)
        await self._tell_state()
        if percent and not self._charged.is_set():
            self._charged.set()
            await self.come_back()

    # Faults, each as the wearer or the air would cause it.

    async def drop_link(self) -> None:
        """Lose the link as by a supervision timeout; advertise again."""
        if self._peripheral is not None:
            await self._peripheral.drop()

    def silence(self) -> None:
        """Send and answer nothing more; the link stays up."""
        self._mute(muted=True)

    def speak(self) -> None:
        """End a silence."""
        self._mute(muted=False)

    def corrupt_next(self, packets: int = 1) -> None:
        """Break the first byte of the next packets, so that their version is none."""
        self._corrupt += packets

    async def go_away(self) -> None:
        """Leave the host's range: no link, no advertising. The sensor goes on."""
        await self._range(away=True)

    async def come_back(self) -> None:
        """Come back into range."""
        await self._range(away=False)

    async def reboot(self) -> None:
        """Start again: next boot number, samples and ticks from 0, no link."""
        self.bracelet.reset()
        await self.drop_link()

    def _mute(self, *, muted: bool) -> None:
        self._muted = muted
        if self._peripheral is not None:
            self._peripheral.muted = muted
            if self._peripheral.listening:
                self._listened.set()

    async def _range(self, *, away: bool) -> None:
        self._away = away
        if self._peripheral is not None:
            self._peripheral.away = away
            await self._peripheral.settle()
            if away:
                await self._peripheral.drop()

    async def _run(self) -> None:
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._stay_on_air())
            tasks.create_task(self._play())
            tasks.create_task(self._report())

    async def _stop(self) -> None:
        task, self._task = self._task, None
        if task is None:
            return
        task.cancel()
        await asyncio.wait({task})
        if not task.cancelled() and (error := task.exception()) is not None:
            raise _first(error)

    async def _stay_on_air(self) -> None:
        while True:
            peripheral = None
            try:
                async with self._air.attach(self._name) as transport:
                    peripheral = self._power_on(transport)
                    try:
                        await peripheral.start()
                        self._attached.set()
                        await peripheral.serve()
                    finally:
                        await peripheral.settle_commands()
            except LinkError:
                if not self._attached.is_set():
                    raise
            finally:
                self._peripheral = None
                if peripheral is not None:
                    self._links_before += peripheral.links_made
                    await peripheral.close()
            await asyncio.sleep(REOPEN_S)

    def _power_on(self, transport: Transport) -> Peripheral:
        peripheral = Peripheral(
            transport,
            self.bracelet,
            name=self._name,
            max_mtu=self._max_mtu,
            encrypted=self._encrypted,
            on_asked=self._on_asked,
        )
        peripheral.muted, peripheral.away = self._muted, self._away
        self._peripheral = peripheral
        return peripheral

    def _on_asked(self) -> None:
        if self.subscribed:
            self._listened.set()
        self._asked.set()

    async def _report(self) -> None:
        """Send again what a host asks for, live packets going first."""
        while True:
            await self._asked.wait()
            peripheral = self._peripheral
            if peripheral is None or not peripheral.control.reporting:
                self._asked.clear()
            elif self._muted:
                await asyncio.sleep(MUTE_POLL_S)
            else:
                await self._send()
                self._packets_again += await peripheral.report()
                await asyncio.sleep(0)

    async def _play(self) -> None:
        if self._start is Start.ON_SUBSCRIBE:
            await self._listened.wait()
        await (self._play_flat_out() if math.isinf(self._speed) else self._play_paced())
        self.played.set()

    async def _play_paced(self) -> None:
        loop = asyncio.get_running_loop()
        began, rate_hz, measured = loop.time(), self._paced_hz, 0
        while not self.bracelet.ended:
            if rate_hz != self._paced_hz:
                began, rate_hz, measured = loop.time(), self._paced_hz, 0
            due = int((loop.time() - began) * rate_hz + 1e-6)
            measured += self.bracelet.measure(min(due - measured, TURN_SAMPLES))
            await self._send()
            await self._tell_state()
            if not self._charged.is_set():
                await self._charged.wait()
                began, measured = loop.time(), 0
            full = measured + max(1, self.bracelet.wanting(self._mtu))
            await asyncio.sleep(max(0.0, began + full / rate_hz - loop.time()))

    @property
    def _paced_hz(self) -> float:
        """Samples a second of the loop's clock."""
        return self.bracelet.true_rate_hz * self._speed

    async def _play_flat_out(self) -> None:
        while not self.bracelet.ended:
            if not self.subscribed:
                self._listened.clear()
                await self._listened.wait()
                continue
            self.bracelet.measure(self.bracelet.wanting(self._mtu))
            await self._send()
            await self._tell_state()
            await self._charged.wait()
            await asyncio.sleep(0)

    async def _tell_state(self) -> None:
        """Notify charge and register where they have changed; with an empty battery leave the air, and all is lost."""
        bracelet = self.bracelet
        before, self._told = self._told, (bracelet.battery.percent, bracelet.steps // REGISTER_EVERY)
        if self._peripheral is not None:
            if self._told[0] != before[0]:
                await self._peripheral.notify_battery()
            if self._told[1] != before[1]:
                await self._peripheral.notify_register()
        await self._tell_pace()
        if not bracelet.battery.percent and self._charged.is_set():
            self._charged.clear()
            bracelet.reset()
            await self.go_away()

    async def _tell_pace(self) -> None:
        """Notify running speed and cadence, once a second of device time."""
        now_s = self.bracelet.now_s
        if 0 <= now_s - self._paced_s < PACE_EVERY_S:
            return
        self._paced_s = now_s
        self._pace.take(now_s, self.bracelet.steps)
        if self._peripheral is not None and self.bracelet.control:
            await self._peripheral.notify_pace(rsc.encode(self._pace.measurement()))

    @property
    def _mtu(self) -> int:
        return DEFAULT_MTU if self._peripheral is None else self._peripheral.mtu

    async def _send(self) -> None:
        """Notify every full packet; discard what nobody takes."""
        while self.subscribed and (packet := self.bracelet.next_packet(self._mtu)):
            if self._corrupt:
                self._corrupt -= 1
                packet = bytes([packet[0] ^ 0xFF]) + packet[1:]
            for value in (packet,) if self.distort is None else self.distort(packet):
                if self._peripheral is not None and await self._peripheral.notify(value):
                    self._packets += 1
        if not self.subscribed:
            self.bracelet.discard()


def _first(error: BaseException) -> BaseException:
    """Return the first error of a group: which of the bracelet's tasks failed is its own affair."""
    return _first(error.exceptions[0]) if isinstance(error, BaseExceptionGroup) else error
