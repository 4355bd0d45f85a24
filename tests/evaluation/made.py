"""Recordings made for tests: a plain walk whose steps are known, in memory and on disk."""

from pathlib import Path

import numpy as np

from service.recordings import Recording

STEP_HZ = 2.0


def walk(seconds=20.0, rate_hz=50.0, *, swing_g=0.5, step_hz=STEP_HZ, start_s=0.0, **changes):
    """A walk of `step_hz * seconds` steps, one at each crest of the norm; all three sensors."""
    t_s = np.arange(round(seconds * rate_hz)) / rate_hz
    phase = 2 * np.pi * step_hz * t_s
    zero = np.zeros_like(t_s)
    true_t_s = (np.arange(round(step_hz * seconds)) + 0.25) / step_hz
    made = {
        "path": Path("walk.npz"),
        "t_s": t_s + start_s,
        "acc_g": np.column_stack([zero, zero, 1 + swing_g * np.sin(phase)]),
        "rate_hz": rate_hz,
        "gyro_rad_s": np.column_stack([2 * np.sin(phase / 2), zero, zero]),
        "mag_ut": np.column_stack([40 + 10 * np.cos(phase / 2), zero, zero]),
        "step_t_s": true_t_s + start_s,
        "true_steps": len(true_t_s),
    }
    return Recording(**(made | changes))


def still(seconds=60.0, rate_hz=50.0):
    """A device at rest: no step, and no step time."""
    n = round(seconds * rate_hz)
    acc_g = np.tile([0.0, 0.0, 1.0], (n, 1))
    return Recording(path=Path("still.npz"), t_s=np.arange(n) / rate_hz, acc_g=acc_g, rate_hz=rate_hz, true_steps=0)


def save(recording, path, **more):
    """Write `recording` as the archives of the data sets are written."""
    arrays = {"t": recording.t_s, "acc": recording.acc_g, "rate_hz": recording.rate_hz}
    if recording.gyro_rad_s is not None:
        arrays["gyro"] = np.rad2deg(recording.gyro_rad_s)
    optional = {"mag": recording.mag_ut, "step_t": recording.step_t_s, "true_steps": recording.true_steps}
    arrays |= {name: value for name, value in optional.items() if value is not None}
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(path, **(arrays | more))
    return path
