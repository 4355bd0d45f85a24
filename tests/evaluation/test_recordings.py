"""Real recordings: live, plain and compiled counts are the same, and `evaluate` prints what the counters promise."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest
from evaluation.lossless import live_steps

from device_sim.bracelet import Bracelet
from device_sim.source import RecordingSource
from service.counters import double_threshold, registry
from service.evaluation.counting import count, grid_block, sensors
from service.recordings import read
from service.samples import Packet, RawBlock, StepCounted
from service.signals.timebase import Timebase
from service.tracking.tracker import Tracker
from service.wearables import bracelet as wire

pytestmark = pytest.mark.full

MOST_OF_A_SET = 40
"""Of a data set with more recordings each n-th is taken, so that the whole stays a matter of minutes."""

DATASETS = (
    "banglejs_walk", "brajdic_handling", "brajdic_walk", "dcaiti", "eth2022_wrist", "eth2023_wrist",
    "negatives_banglejs", "negatives_hmp", "negatives_spar_watch", "oxford_opt", "oxford_opt_B", "pebble_wrist",
    "sensorwatch_magonly", "voisard_lowback",
)  # fmt: skip

COLUMNS = {
    "eth2023": "eth2023_wrist",
    "eth2022": "eth2022_wrist",
    "banglejs": "banglejs_walk",
    "pebble": "pebble_wrist",
    "oxford_opt": "oxford_opt",
    "hmp": "negatives_hmp",
    "spar": "negatives_spar_watch",
    "driving, desk": "negatives_banglejs",
}
"""A docstring's column and its data set."""


def some_of(folder):
    paths = sorted(folder.glob("*.npz"))
    assert paths, f"{folder} holds no recording"
    return paths[:: -(-len(paths) // MOST_OF_A_SET)]


def variants_for(block):
    has = sensors(block)
    return [(name, "tuned") for name, kind in registry.COUNTERS.items() if kind.sensors <= has]


@pytest.mark.parametrize("dataset", DATASETS)
def test_live_plain_and_compiled_counts_are_the_same(recordings, dataset):
    """Every counter that the recording has the sensors for; packets carry the values unrounded."""
    for path in some_of(recordings / dataset):
        recording = read(path)
        block = grid_block(recording)
        variants = variants_for(block)
        live = live_steps(recording, variants)
        for variant in variants:
            fast, plain = (count(block, *variant, fast=fast).step_t_s.tolist() for fast in (True, False))
            assert fast == plain == live[variant], f"{path.name} {variant}"


@pytest.mark.parametrize("dataset", ["eth2022_wrist", "eth2023_wrist", "banglejs_walk"])
def test_a_bracelets_own_packets_give_what_their_values_give(recordings, dataset):
    """Quantised to 4096 LSB/g, at MTU 517, with the bracelet's ticks."""
    for path in some_of(recordings / dataset):
        bracelet = Bracelet(RecordingSource(read(path)))
        tracker = Tracker(
            wire.Bracelet(), {"double_threshold": lambda: registry.make("double_threshold")}, primary="double_threshold"
        )
        said = {wire.BOOT: bracelet.boot_value(), wire.SCALE: bracelet.scale_value(), wire.RATE: bracelet.rate_value()}
        events = [
            e for uuid, data in said.items() for e in tracker.apply(Packet(characteristic=uuid, data=data, at_ns=0))
        ]
        codec, values = wire.Bracelet(), []
        codec.feed(wire.SCALE, said[wire.SCALE])
        while not bracelet.ended:
            bracelet.measure(10)
            while (data := bracelet.next_packet(517)) is not None:
                values.append(np.array(codec.feed(wire.DATA, data).acc_g))
                events += tracker.apply(Packet(characteristic=wire.DATA, data=data, at_ns=0))
        events += tracker.finish()
        whole = RawBlock(boot=1, index=0, tick=None, acc_g=tuple(np.concatenate(values, axis=1)))
        block, _ = Timebase(bracelet.rate_hz).feed(whole)
        assert [e.step.at_s for e in events if isinstance(e, StepCounted)] == count(block).step_t_s.tolist(), path.name


def documented(name):
    """The figures of a row of the double threshold's docstring, by data set."""
    lines = double_threshold.__doc__.splitlines()
    header = next(line for line in lines if line.startswith("| | eth2023"))
    row = next(
        line
        for line in lines
        if line.startswith(f"| {name} |") and re.search(r"\d", line) and line.count("|") == header.count("|")
    )
    names, figures = ([cell.strip() for cell in line.strip("|").split("|")][1:] for line in (header, row))
    return {COLUMNS[name]: float(figure) for name, figure in zip(names, figures, strict=True)}


@pytest.mark.parametrize("preset", ["paper", "tuned"])
def test_evaluate_gives_the_figures_of_the_docstring(recordings, tmp_path, preset):
    out, wanted = tmp_path / "rows.json", documented(preset)
    words = ["evaluate", *(str(recordings / dataset) for dataset in wanted), "--preset", preset, "--json", str(out)]
    answer = subprocess.run([sys.executable, "-m", "service.cli", *words], capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr
    rows = json.loads(out.read_text("utf-8"))
    assert not [row["error"] for row in rows if row["error"]]
    found = {dataset: figure([row for row in rows if row["dataset"] == dataset]) for dataset in wanted}
    assert found == {name: pytest.approx(value, rel=0.01, abs=0.11) for name, value in wanted.items()}
    assert all(dataset in answer.stdout for dataset in wanted)


def figure(rows):
    """The mean absolute percentage error of the walks, or the false steps an hour of a set without any."""
    walks = [row for row in rows if row["true_steps"]]
    if not walks:
        return sum(row["steps"] for row in rows) / sum(row["duration_s"] for row in rows) * 3600
    return 100 * float(np.mean([abs(row["steps"] - row["true_steps"]) / row["true_steps"] for row in walks]))
