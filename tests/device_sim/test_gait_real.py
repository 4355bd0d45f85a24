"""Synthetic against real: a walk and a run look like the recordings that they were measured on, within factors."""

from dataclasses import dataclass

import numpy as np
import pytest

from device_sim.gait import Walker
from service.recordings import read

WINDOW_S = 4.0
MIN_SD_G = 0.05
"""Windows quieter than this hold no steps."""


@dataclass
class Look:
    """Medians over windows of 4 s; `half_g` is of the vector, the others are of its norm."""

    sd_g: float
    step_g: float
    half_g: float
    peaks_g: np.ndarray


def spectrum(values, rate_hz, at_hz):
    """Amplitudes at the frequencies `at_hz`, by projection on Hann-weighted sines."""
    weight = np.hanning(len(values))
    t_s = np.arange(len(values)) / rate_hz
    waves = weight * np.exp(-2j * np.pi * np.outer(at_hz, t_s))
    return 2 * np.abs(waves @ (values - values.mean(axis=0))) / weight.sum()


def windows(acc_g, rate_hz):
    n = int(WINDOW_S * rate_hz)
    return [acc_g[at : at + n] for at in range(0, len(acc_g) - n + 1, n)]


def look(parts, rate_hz, low_hz, high_hz):
    rows, peaks = [], []
    grid_hz = np.arange(low_hz, high_hz, 0.02)
    for part in parts:
        norm = np.linalg.norm(part, axis=1)
        if norm.std() < MIN_SD_G:
            continue
        amplitudes = spectrum(norm, rate_hz, grid_hz)
        step_hz = grid_hz[np.argmax(amplitudes)]
        half_g = np.linalg.norm(spectrum(part, rate_hz, [step_hz / 2]))
        rows.append((norm.std(), amplitudes.max(), half_g))
        step = max(2, int(rate_hz / step_hz))
        peaks += [norm[at : at + step].max() for at in range(0, len(norm) - step, step)]
    return Look(*np.median(rows, axis=0), np.percentile(peaks, [25, 50, 75]))


def real(paths, low_hz, high_hz):
    parts = []
    for path in paths:
        recording = read(path)
        rate_hz = recording.rate_hz
        parts += windows(recording.acc_g, rate_hz)
    return look(parts, rate_hz, low_hz, high_hz)


def synthetic(activity, rate_hz, low_hz, high_hz):
    return look(
        windows(Walker(f"{activity}:4min", rate_hz=rate_hz, seed=1).read(10**6), rate_hz), rate_hz, low_hz, high_hz
    )


def ratios(ours, theirs):
    return {
        "sd": ours.sd_g / theirs.sd_g,
        "step": ours.step_g / theirs.step_g,
        "half": ours.half_g / theirs.half_g,
        "peak": ours.peaks_g[1] / theirs.peaks_g[1],
        "spread": np.ptp(ours.peaks_g) / np.ptp(theirs.peaks_g),
    }


def outside(found, allowed):
    return {name: value for name, value in found.items() if not 1 / allowed[name] <= value <= allowed[name]}


@pytest.mark.full
def test_a_normal_walk(recordings):
    """Against all windows of 62 walks of 100 and 200 steps, also those that the row left out as irregular.

    One synthetic wearer spreads less than all of them together.
    """
    theirs = real(sorted((recordings / "pebble_wrist").glob("walk_[12]00_*.npz")), 1.6, 2.1)
    found = ratios(synthetic("normal", 25.0, 1.6, 2.1), theirs)
    assert not outside(found, {"sd": 1.2, "step": 1.25, "half": 1.35, "peak": 1.2, "spread": 2.0}), found


@pytest.mark.full
def test_a_walk_of_another_sensor(recordings):
    """Against eth2023, on which nothing but the variations was measured."""
    theirs = real([recordings / "eth2023_wrist" / f"labeled_0{k}.npz" for k in (1, 2, 4)], 1.5, 2.1)
    found = ratios(synthetic("normal", 100.0, 1.5, 2.1), theirs)
    assert not outside(found, {"sd": 1.5, "step": 1.5, "half": 2.2, "peak": 1.25, "spread": 2.0}), found


@pytest.mark.full
def test_a_run(recordings):
    theirs = real([recordings / "pebble_wrist" / "running_100.npz"], 2.4, 3.0)
    found = ratios(synthetic("run", 25.0, 2.4, 3.0), theirs)
    assert not outside(found, {"sd": 1.2, "step": 1.25, "half": 1.25, "peak": 1.2, "spread": 2.0}), found
