"""A bluetoothd with one adapter and one bracelet, on a D-Bus of its own: what bleak's BlueZ backend really talks to.

Only what cannot run without a kernel's Bluetooth is played: the objects of `org.bluez` (BlueZ's doc/*.rst). As in BlueZ
object paths stay the same over reconnects, a lost link is `Connected` that turns false, and whoever asked for
notifications is remembered over lost links until its D-Bus connection ends: a value is one signal *for each of them*,
which is what bleak #2002 suffers from.
"""

# ruff: noqa: F722, F821, N802  # D-Bus's own names, and its signatures as annotations

import asyncio
import contextlib
import os
import subprocess

from dbus_fast import BusType, Message, PropertyAccess
from dbus_fast.aio import MessageBus
from dbus_fast.constants import NameFlag
from dbus_fast.service import ServiceInterface, dbus_method, dbus_property

from service.wearables import bracelet as wire

ADDRESS = "C0:00:00:00:00:01"
ADAPTER = "/org/bluez/hci0"
DEVICE = f"{ADAPTER}/dev_{ADDRESS.replace(':', '_')}"
SERVICE = f"{DEVICE}/service0001"
DATA = f"{SERVICE}/char0002"
ADVERTISED_EVERY_S = 0.05
DBUS = {"destination": "org.freedesktop.DBus", "path": "/org/freedesktop/DBus", "interface": "org.freedesktop.DBus"}


class Interface(ServiceInterface):
    """An interface whose `_` attributes are told by `change`."""

    def change(self, **values):
        for name, value in values.items():
            setattr(self, f"_{name.lower()}", value)
        self.emit_properties_changed(values)


class Adapter(Interface):
    def __init__(self, device):
        super().__init__("org.bluez.Adapter1")
        self._discovering = False
        self._device = device

    @dbus_property(access=PropertyAccess.READ)
    def Address(self) -> "s":
        return "C0:00:00:00:00:FF"

    @dbus_property(access=PropertyAccess.READ)
    def Powered(self) -> "b":
        return True

    @dbus_property(access=PropertyAccess.READ)
    def Roles(self) -> "as":
        return ["central"]

    @dbus_property(access=PropertyAccess.READ)
    def Discovering(self) -> "b":
        return self._discovering

    @dbus_method()
    def SetDiscoveryFilter(self, _filter: "a{sv}"):
        pass

    @dbus_method()
    def StartDiscovery(self):
        self.change(Discovering=True)

    @dbus_method()
    def StopDiscovery(self):
        self.change(Discovering=False)

    async def advertise(self):
        """Report the device while somebody scans."""
        rssi = -50
        while True:
            await asyncio.sleep(ADVERTISED_EVERY_S)
            if self._discovering and not self._device.connected:
                rssi = -50 if rssi < -50 else -51
                self._device.change(RSSI=rssi)


class Device(Interface):
    def __init__(self):
        super().__init__("org.bluez.Device1")
        self._connected = self._servicesresolved = False
        self._rssi = -50
        self.links = 0

    @property
    def connected(self):
        return self._connected

    @dbus_property(access=PropertyAccess.READ)
    def Address(self) -> "s":
        return ADDRESS

    @dbus_property(access=PropertyAccess.READ)
    def Alias(self) -> "s":
        return "Steplink"

    @dbus_property(access=PropertyAccess.READ)
    def Name(self) -> "s":
        return "Steplink"

    @dbus_property(access=PropertyAccess.READ)
    def Adapter(self) -> "o":
        return ADAPTER

    @dbus_property(access=PropertyAccess.READ)
    def UUIDs(self) -> "as":
        return [wire.SERVICE]

    @dbus_property(access=PropertyAccess.READ)
    def RSSI(self) -> "n":
        return self._rssi

    @dbus_property(access=PropertyAccess.READ)
    def Connected(self) -> "b":
        return self._connected

    @dbus_property(access=PropertyAccess.READ)
    def ServicesResolved(self) -> "b":
        return self._servicesresolved

    @dbus_method()
    def Connect(self):
        self.links += 1
        self.change(Connected=True)
        self.change(ServicesResolved=True)

    @dbus_method()
    def Disconnect(self):
        self.lose()

    def lose(self):
        """Lose the link: out of range."""
        if self._connected:
            self.change(ServicesResolved=False)
            self.change(Connected=False)


class Service(Interface):
    def __init__(self):
        super().__init__("org.bluez.GattService1")

    @dbus_property(access=PropertyAccess.READ)
    def UUID(self) -> "s":
        return wire.SERVICE

    @dbus_property(access=PropertyAccess.READ)
    def Primary(self) -> "b":
        return True

    @dbus_property(access=PropertyAccess.READ)
    def Device(self) -> "o":
        return DEVICE


class Characteristic(Interface):
    def __init__(self):
        super().__init__("org.bluez.GattCharacteristic1")
        self._value = b""
        self.clients = set()
        """D-Bus names of who asked for notifications."""

    @dbus_property(access=PropertyAccess.READ)
    def UUID(self) -> "s":
        return wire.DATA

    @dbus_property(access=PropertyAccess.READ)
    def Service(self) -> "o":
        return SERVICE

    @dbus_property(access=PropertyAccess.READ)
    def Flags(self) -> "as":
        return ["notify"]

    @dbus_property(access=PropertyAccess.READ)
    def Value(self) -> "ay":
        return self._value

    @dbus_method()
    def StartNotify(self):
        """Answer; who asked is noted by `hear`, which sees the message."""

    @dbus_method()
    def StopNotify(self):
        """Answer, as above."""

    def hear(self, message):
        """Note who asks, and who has gone."""
        if message.path == DATA and message.member == "StartNotify":
            self.clients.add(message.sender)
        elif message.path == DATA and message.member == "StopNotify":
            self.clients.discard(message.sender)
        elif message.member == "NameOwnerChanged" and not message.body[2]:
            self.clients.discard(message.body[0])

    def notify(self, value):
        for _ in self.clients:
            self.change(Value=value)


class Bluetoothd:
    """The objects, for a test to drive."""

    def __init__(self):
        self.device, self.data = Device(), Characteristic()
        self.adapter = Adapter(self.device)


@contextlib.asynccontextmanager
async def bluetoothd(folder):
    """A bus in `folder` that is the system's while entered, and the daemon on it."""
    address = f"unix:path={folder / 'bus'}"
    before = os.environ.get("DBUS_SYSTEM_BUS_ADDRESS")
    command = ["dbus-daemon", "--session", "--nofork", "--nosyslog", f"--address={address}", "--print-address"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as bus_daemon:  # noqa: ASYNC220
        bus_daemon.stdout.readline()
        os.environ["DBUS_SYSTEM_BUS_ADDRESS"] = address
        bus = await MessageBus(bus_type=BusType.SYSTEM).connect()
        made = Bluetoothd()
        for path, interface in (
            (ADAPTER, made.adapter),
            (DEVICE, made.device),
            (SERVICE, Service()),
            (DATA, made.data),
        ):
            bus.export(path, interface)
        bus.add_message_handler(made.data.hear)
        await bus.call(Message(**DBUS, member="AddMatch", signature="s", body=["member='NameOwnerChanged'"]))
        await bus.request_name("org.bluez", NameFlag.DO_NOT_QUEUE)
        advertising = asyncio.create_task(made.adapter.advertise())
        try:
            yield made
        finally:
            advertising.cancel()
            bus.disconnect()
            await bus.wait_for_disconnect()
            bus_daemon.terminate()
            if before is None:
                del os.environ["DBUS_SYSTEM_BUS_ADDRESS"]
            else:
                os.environ["DBUS_SYSTEM_BUS_ADDRESS"] = before
