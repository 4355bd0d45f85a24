"""The bracelet's battery: it drains evenly with device time, and a flat one ends everything."""

from __future__ import annotations

import math

from service.errors import ParameterError


class Battery:
    """Lasts `hours` from full to empty; None: for ever."""

    def __init__(self, percent: int = 100, hours: float | None = None) -> None:
        if hours is not None and not hours > 0:
            raise ParameterError("battery_hours", hours, "more than 0 h from full to empty")
        self._drain_s = 0.0 if hours is None else 100 / (hours * 3600)
        self._charge = 0.0
        self.charge(percent)

    @property
    def percent(self) -> int:
        """Charge in whole percent, of which the last is shown until nothing is left."""
        return math.ceil(self._charge - 1e-6)

    def charge(self, percent: int) -> None:
        """Set the charge."""
        if not 0 <= percent <= 100:
            raise ParameterError("battery_percent", percent, "0 to 100 %")
        self._charge = float(percent)

    def run(self, seconds: float) -> None:
        """Drain for some device time."""
        self._charge = max(0.0, self._charge - seconds * self._drain_s)
