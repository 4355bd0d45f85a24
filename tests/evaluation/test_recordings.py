"""Real recordings: live, plain and compiled counts are the same, and `evaluate` prints what the counters promise."""

import json
import subprocess
import sys
from functools import partial

import numpy as np
import pytest
from evaluation.lossless import live_steps

from device_sim.bracelet import Bracelet
from device_sim.source import RecordingSource
from service.counters import double_threshold, registry
from service.evaluation.counting import count, grid_block, sensors
from service.events import StepCounted
from service.recordings import read, stated_rate_hz
from service.samples import Packet, RawBlock
from service.signals.timebase import Timebase
from service.tracking.tracker import Tracker
from service.wearables import bracelet as wire

pytestmark = pytest.mark.full

DATASETS = (
    "banglejs_walk", "brajdic_handling", "brajdic_walk", "dcaiti", "eth2022_wrist", "eth2023_wrist",
    "negatives_banglejs", "negatives_hmp", "negatives_spar_watch", "oxford_opt", "oxford_opt_B", "pebble_wrist",
    "sensorwatch_magonly", "voisard_lowback",
)  # fmt: skip

PRESETS = ("paper", "tuned")

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


def all_of(folder):
    paths = sorted(folder.glob("*.npz"))
    assert paths, f"{folder} holds no recording"
    return paths


def variants_for(block):
    has = sensors(block)
    return [(name, preset) for name, kind in registry.COUNTERS.items() if kind.sensors <= has for preset in PRESETS]


@pytest.mark.parametrize("dataset", DATASETS)
def test_live_plain_and_compiled_counts_are_the_same(recordings, dataset):
    """Every counter that the recording has the sensors for, with both presets; packets carry the values unrounded."""
    for path in all_of(recordings / dataset):
        recording = read(path)
        block = grid_block(recording)
        variants = variants_for(block)
        live = live_steps(recording, variants)
        for variant in variants:
            fast, plain = (count(block, *variant, fast=fast).step_t_s.tolist() for fast in (True, False))
            assert fast == plain == live[variant], f"{path.name} {variant}"


def sent(recording):
    """What a bracelet that plays the recording says and sends: {uuid: value}, then the packets."""
    bracelet = Bracelet(RecordingSource(recording))
    said = {wire.BOOT: bracelet.boot_value(), wire.SCALE: bracelet.scale_value(), wire.RATE: bracelet.rate_value()}
    packets = []
    while not bracelet.ended:
        bracelet.measure(10)
        while (data := bracelet.next_packet(517)) is not None:
            packets.append(data)
    return said, packets


@pytest.mark.parametrize("dataset", ["eth2022_wrist", "eth2023_wrist", "banglejs_walk"])
def test_a_bracelets_own_packets_give_what_their_values_give(recordings, dataset):
    """Quantised to 4096 LSB/g, with the bracelet's ticks."""
    for path in all_of(recordings / dataset):
        recording = read(path)
        said, packets = sent(recording)
        name = registry.DEFAULT
        tracker, codec = Tracker(wire.Bracelet(), {name: partial(registry.make, name)}, primary=name), wire.Bracelet()
        codec.feed(wire.SCALE, said[wire.SCALE])
        events = []
        for uuid, data in [*said.items(), *((wire.DATA, data) for data in packets)]:
            events += tracker.apply(Packet(characteristic=uuid, data=data, at_ns=0))
        events += tracker.finish()
        values = np.concatenate([np.array(codec.feed(wire.DATA, data).acc_g) for data in packets], axis=1)
        block, _ = Timebase(stated_rate_hz(recording)).feed(RawBlock(boot=1, index=0, tick=None, acc_g=tuple(values)))
        live_s = [event.step.at_s for event in events if isinstance(event, StepCounted)]
        assert live_s == count(block).step_t_s.tolist(), path.name


def documented(name):
    """The figures of a row of the double threshold's docstring, by data set."""
    table = [line.strip("|").split("|") for line in double_threshold.__doc__.splitlines() if line.startswith("|")]
    names = next(cells for cells in table if "eth2023" in cells[1])
    figures = next(cells for cells in table if cells[0].strip() == name and len(cells) == len(names))
    return {COLUMNS[column.strip()]: float(cell) for column, cell in zip(names[1:], figures[1:], strict=True)}


@pytest.mark.parametrize("preset", PRESETS)
def test_evaluate_gives_the_figures_of_the_docstring(recordings, tmp_path, preset):
    out, wanted = tmp_path / "rows.json", documented(preset)
    words = ["evaluate", *(str(recordings / dataset) for dataset in wanted), "--counter", "double_threshold"]
    words += ["--preset", preset, "--json", str(out)]
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
