"""The guide's table of how soon steps are told, measured again on every development recording that holds steps."""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

import service
from service.counters import registry
from service.evaluation.counting import grid_block, pieces, sensors
from service.recordings import read
from service.samples import GRID_HZ

pytestmark = pytest.mark.full

GUIDE = Path(service.__file__).parent / "guide" / "navigation.md"
WALKS = ("banglejs_walk", "brajdic_walk", "dcaiti", "eth2022_wrist", "eth2023_wrist", "oxford_opt", "pebble_wrist")
PACKET_SAMPLES = 8
SOON_S = 0.25
PROMISED = ("double_threshold", "adaptive_peak", "conventional_peak", "plus_minus")


@dataclass
class Told:
    """How long after each confirmed step it was told, and what became of what was told."""

    delays_s: list[float] = field(default_factory=list)
    passed: int = 0
    retracted: int = 0
    retracted_that_passed: int = 0

    def row(self) -> list[float]:
        delays_s, steps = np.array(self.delays_s), len(self.delays_s)
        return [
            100 * np.mean(delays_s <= SOON_S + 1e-9), np.median(delays_s), np.percentile(delays_s, 95), delays_s.max(),
            self.retracted / steps, 100 * self.passed / steps, self.retracted_that_passed / steps,
        ]  # fmt: skip


def follow(name: str, block, told: Told) -> None:
    """Count `block` in packets, and note when each step was first told."""
    counter = registry.make(name)
    first_s: dict[float, float] = {}
    waiting: dict[float, bool] = {}
    for part in pieces(block, PACKET_SAMPLES):
        update = counter.update(part)
        now_s = (part.start + len(part) - 1) / GRID_HZ
        likely = {at_s: passes for at_s, _, passes in update.likely}
        for at_s, passes in likely.items():
            first_s.setdefault(at_s, now_s)
            waiting.setdefault(at_s, passes)
        confirmed = {step.at_s for step in update.steps}
        for at_s in confirmed:
            told.delays_s.append(first_s.get(at_s, now_s) - at_s)
            told.passed += waiting.get(at_s, False)
        for at_s in waiting.keys() - likely.keys():
            passed = waiting.pop(at_s)
            told.retracted += at_s not in confirmed
            told.retracted_that_passed += passed and at_s not in confirmed


def measured(name: str, recordings: Path) -> list[float]:
    told = Told()
    for dataset in WALKS:
        for path in sorted((recordings / dataset).glob("*.npz")):
            recording = read(path)
            block = grid_block(recording)
            if recording.true_steps and registry.kind(name).sensors <= sensors(block):
                follow(name, block, told)
    return told.row()


def printed(name: str) -> list[float]:
    """The figures of a counter's row in the guide."""
    (line,) = re.findall(rf"^\| {name} \|(.*)\|$", GUIDE.read_text("utf-8"), flags=re.MULTILINE)
    return [float(re.findall(r"[\d.]+", cell)[0]) for cell in line.split("|")]


@pytest.mark.parametrize("name", registry.COUNTERS)
def test_steps_are_told_as_soon_as_the_guide_says(recordings, name):
    row = measured(name, recordings)
    print(name, " | ".join(f"{value:.2f}" for value in row))
    assert row == pytest.approx(printed(name), abs=0.006, rel=0.007)
    if name in PROMISED:
        assert row[0] == 100
