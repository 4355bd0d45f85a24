"""What tests of the scorecard share: no compilation, and recordings measured by hand."""

from pathlib import Path

import pytest

from service.evaluation.choices import Found
from service.evaluation.scorecard.measured import Measured


@pytest.fixture(autouse=True)
def _plain_python(monkeypatch):
    """Numba would take longer to compile than these tests to run."""
    monkeypatch.setattr("service.counters.streaming.compiled", lambda kernel: kernel)
    monkeypatch.setattr("service.signals.timebase.compiled", lambda kernel: kernel)
    monkeypatch.setattr("service.evaluation.counting.available", lambda: False)


@pytest.fixture
def row():
    """Make a measured recording; by default a wrist walk of 100 steps, all counted."""

    def made(name="w", dataset="walks", **changes):
        file = Found(shown=f"{dataset}/{name}.npz", path=Path(dataset) / f"{name}.npz", dataset=dataset)
        known = {
            "file": file, "counter": "double_threshold", "placement": "wrist", "activity": "walk", "subject": "s1",
            "rate_hz": 50.0, "duration_s": 60.0, "true_steps": 100, "steps": 100,
        }  # fmt: skip
        return Measured(**(known | changes))

    return made
