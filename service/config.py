"""Every option of the service, in one place: the command line and its help are made from these fields."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from service.errors import ParameterError


def option(default: Any, text: str, *, unit: str = "", low: float | None = None, high: float | None = None) -> Any:  # noqa: ANN401
    """Declare an option: its default, what it does, its unit and range (inclusive)."""
    return field(default=default, metadata={"text": text, "unit": unit, "low": low, "high": high})


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The service's options; ParameterError where one is out of range."""

    host: str = option("127.0.0.1", "address to listen on; only this machine's own addresses are allowed for now")
    port: int = option(8600, "TCP port to listen on; 0 picks a free one", low=0, high=65535)
    counter: str = option("steplink", "counter whose count is a device's steps")
    preset: str = option("tuned", "its parameters: paper (as published) or tuned")
    beside: tuple[str, ...] = option(
        ("double_threshold",),
        "another counter to run on the same stream; may be repeated; none: no other",
        unit="name",
    )
    param: tuple[str, ...] = option((), "a parameter of a counter, NAME.KEY=VALUE; may be repeated", unit="name.key=v")
    weights: str = option(
        "", "weights of the counter steplink, a file that `steplink train` made; without it those that come with it"
    )
    durable_limit: int = option(
        1000, "events that may wait for a slow reader before it is closed", unit="events", low=10, high=100_000
    )

    store: str = option(
        "",
        "database file that keeps steps, samples and sessions over restarts; without it `serve` uses the user's data"
        " folder, and `demo` one that goes when it ends",
    )
    keep_raw_days: float = option(
        30.0, "raw samples older than this are deleted; 0: never", unit="days", low=0.0, high=36_500.0
    )
    keep_raw_mb: float = option(
        10_000.0,
        "raw samples are deleted, oldest first, while the database is larger than this; 0: never",
        unit="MB",
        low=0.0,
        high=1e9,
    )
    keep_log_days: float = option(
        0.0, "steps and events older than this are deleted, counts stay; 0: never", unit="days", low=0.0, high=36_500.0
    )

    def __post_init__(self) -> None:
        """Check ranges, and that nobody else can reach an interface without access control."""
        for name, spec in self.__dataclass_fields__.items():
            low, high, value = spec.metadata["low"], spec.metadata["high"], getattr(self, name)
            if low is not None and not low <= value <= high:
                raise ParameterError(name, value, f"from {low} to {high} {spec.metadata['unit']}".rstrip())
        if self.host not in LOOPBACK:
            raise ParameterError("host", self.host, f"one of {', '.join(LOOPBACK)}: the API has no access control yet")


LOOPBACK = ("127.0.0.1", "::1", "localhost")
