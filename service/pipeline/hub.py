"""The hub: every notice to every subscriber, and no subscriber ever holds up another or the counting.

Each subscription has a bounded queue of durable notices (policy: the subscriber is closed when it is full, for a
durable event may not be left out) and one slot a device and kind for ephemeral ones (policy: conflate, the newest
replaces the one not yet read).
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Collection

from service.pipeline.notices import EPHEMERAL, Notice


class SlowSubscriberError(Exception):
    """The subscriber did not read in time and has been closed: subscribe again, and start from a snapshot."""


class Subscription:
    """One reader's view of the hub. `devices` None means all."""

    def __init__(self, hub: Hub, devices: Collection[str] | None, durable_limit: int) -> None:
        self._hub = hub
        self.devices = None if devices is None else frozenset(devices)
        self._durable: deque[Notice] = deque()
        self._durable_limit = durable_limit
        self._ephemeral: dict[tuple[str, type], Notice] = {}
        self._ready = asyncio.Event()
        self._slow = False
        self.conflated = 0

    def statistics(self) -> dict[str, int | bool]:
        """Return how full the queues are and what was conflated."""
        return {
            "durable": len(self._durable),
            "durable_limit": self._durable_limit,
            "ephemeral": len(self._ephemeral),
            "conflated": self.conflated,
            "slow": self._slow,
        }

    def close(self) -> None:
        """Leave the hub."""
        self._hub.leave(self)

    async def receive(self) -> list[Notice]:
        """Wait for notices and return all there are, durable ones first in order; SlowSubscriberError once closed."""
        await self._ready.wait()
        if self._slow:
            raise SlowSubscriberError
        notices = [*self._durable, *self._ephemeral.values()]
        self._durable.clear()
        self._ephemeral.clear()
        self._ready.clear()
        return notices

    def offer(self, notice: Notice) -> None:
        """Take a notice from the hub, without waiting."""
        if self.devices is not None and notice.device not in self.devices:
            return
        if isinstance(notice.event, EPHEMERAL):
            key = (notice.device, type(notice.event))
            self.conflated += key in self._ephemeral
            self._ephemeral[key] = notice
        elif len(self._durable) >= self._durable_limit:
            self._slow = True
            self.close()
        else:
            self._durable.append(notice)
        self._ready.set()


class Hub:
    """Fan-out of notices to subscriptions."""

    def __init__(self, *, durable_limit: int) -> None:
        self._durable_limit = durable_limit
        self._subscriptions: set[Subscription] = set()

    def subscribe(self, devices: Collection[str] | None = None) -> Subscription:
        """Join; the caller closes the subscription."""
        subscription = Subscription(self, devices, self._durable_limit)
        self._subscriptions.add(subscription)
        return subscription

    def leave(self, subscription: Subscription) -> None:
        """Stop telling `subscription` anything."""
        self._subscriptions.discard(subscription)

    def publish(self, notice: Notice) -> None:
        """Tell every subscriber, without waiting for any."""
        for subscription in tuple(self._subscriptions):
            subscription.offer(notice)

    def statistics(self) -> dict[str, object]:
        """Return each subscriber's statistics."""
        return {"subscribers": [subscription.statistics() for subscription in self._subscriptions]}
