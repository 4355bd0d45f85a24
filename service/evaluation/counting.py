"""One counter over one recording, exactly as it would have counted it live.

The recording is spaced evenly as the emulated bracelet does it and laid on the 50 Hz grid by the same timebase, so a
count here is the count that packets of the same values give. Only counting is timed: not reading, not resampling, not
numba's compilation.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from service.counters import registry
from service.counters.contract import RecordingCounter, StepCounter
from service.counters.streaming import COMPILED_FROM
from service.errors import RecordingError
from service.recordings import Recording, evenly_spaced, stated_rate_hz
from service.recordings.recording import Floats, median_rate_hz
from service.samples import MIN_RATE_HZ, Columns, RawBlock, SampleBlock, Sensor, Step
from service.signals.compiled import available
from service.signals.timebase import Timebase

WARM_UP_SAMPLES: Final = 64
"""Enough to make numba compile every kernel of a counter."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Counted:
    """What a counter said of a recording.

    `step_t_s` are the steps' times in seconds after the recording's first sample, rising; `samples` is their number on
    the 50 Hz grid; `elapsed_s` is the time counting took on one thread.
    """

    step_t_s: NDArray[np.float64]
    samples: int
    elapsed_s: float

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.step_t_s)


def grid_block(recording: Recording) -> SampleBlock:
    """Return the recording on the 50 Hz grid, with every sensor it has; RecordingError under 10 Hz."""
    measured_hz = min(recording.rate_hz, median_rate_hz(recording.t_s))
    # Stamps in milliseconds put a 10 Hz recording a hair under it.
    if measured_hz < 0.99 * MIN_RATE_HZ:
        why = f"{measured_hz:.3g} samples a second; steps need at least {MIN_RATE_HZ:g}: record faster"
        raise RecordingError(str(recording.path), why)
    block, _ = Timebase(stated_rate_hz(recording)).feed(raw_block(recording))
    return block


def raw_block(recording: Recording) -> RawBlock:
    """Return the recording as a device that samples evenly would send it, unquantised and in one piece."""
    rate_hz = stated_rate_hz(recording)

    def columns(values: Floats) -> Columns:
        x, y, z = (np.ascontiguousarray(column) for column in evenly_spaced(recording, values, rate_hz).T)
        return x, y, z

    return RawBlock(
        boot=1,
        index=0,
        tick=None,
        acc_g=columns(recording.acc_g),
        gyro_rad_s=None if recording.gyro_rad_s is None else columns(recording.gyro_rad_s),
        mag_ut=None if recording.mag_ut is None else columns(recording.mag_ut),
    )


def sensors(block: SampleBlock) -> frozenset[Sensor]:
    """Return what `block` holds measurements of."""
    found = {
        Sensor.ACCELEROMETER: block.acc_g,
        Sensor.GYROSCOPE: block.gyro_rad_s,
        Sensor.MAGNETOMETER: block.mag_ut,
    }
    return frozenset(sensor for sensor, columns in found.items() if columns is not None)


def count(
    recording: Recording | SampleBlock,
    counter: str = registry.DEFAULT,
    preset: str = "tuned",
    overrides: Mapping[str, object] | None = None,
    *,
    fast: bool | None = None,
) -> Counted:
    """Count a recording, or the block `grid_block` made of it, with one counter of the registry.

    `fast` asks for numba or for plain Python; None takes what is installed, and both give the same steps, bit for bit.
    CounterError or ParameterError where the counter cannot be built or lacks a sensor; RecordingError under 10 Hz.
    """
    block = recording if isinstance(recording, SampleBlock) else grid_block(recording)
    made = registry.make(counter, preset, overrides, sensors(block))
    if isinstance(made, RecordingCounter) and (available() if fast is None else fast):
        _compile_once(made, block, registry.make(counter, preset, overrides))
        began_s = time.perf_counter()
        rows = made.count(block)
        elapsed_s = time.perf_counter() - began_s
        steps = made.read(rows)
    else:
        parts = pieces(block)
        began_s = time.perf_counter()
        steps = tuple(streamed(made, parts))
        elapsed_s = time.perf_counter() - began_s
    return Counted(step_t_s=np.array([step.at_s for step in steps]), samples=len(block), elapsed_s=elapsed_s)


_compiled: set[tuple[str, str]] = set()
"""Counters this process has compiled, by name and parameters."""


def _compile_once(made: RecordingCounter, block: SampleBlock, spare: StepCounter) -> None:
    key = (made.name, made.snapshot()["params"])
    if key not in _compiled and isinstance(spare, RecordingCounter):
        spare.count(part(block, 0, WARM_UP_SAMPLES, as_lists=False))
        _compiled.add(key)


def streamed(counter: StepCounter, parts: Iterable[SampleBlock]) -> list[Step]:
    """Count `parts`, a whole stream from its start to its end, one after the other."""
    steps = [step for piece in parts for step in counter.update(piece).steps]
    return [*steps, *counter.finish().steps]


def pieces(block: SampleBlock, samples: int = COMPILED_FROM) -> list[SampleBlock]:
    """Cut `block` into lists of `samples`, short enough to go through plain Python."""
    return [part(block, first, first + samples, as_lists=True) for first in range(0, len(block), samples)]


def part(block: SampleBlock, first: int, last: int, *, as_lists: bool) -> SampleBlock:
    """Return samples `first` to `last`, the latter left out, of all sensors of `block`."""

    def cut(columns: Columns | None) -> Columns | None:
        if columns is None:
            return None
        x, y, z = (column[first:last] for column in map(np.asarray, columns))
        return (x.tolist(), y.tolist(), z.tolist()) if as_lists else (x, y, z)

    acc_g = cut(block.acc_g)
    assert acc_g is not None  # noqa: S101  # every block has it
    return SampleBlock(
        start=block.start + first, acc_g=acc_g, gyro_rad_s=cut(block.gyro_rad_s), mag_ut=cut(block.mag_ut)
    )
