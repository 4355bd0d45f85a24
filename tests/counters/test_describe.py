"""The tables of counters and parameters that people read."""

from pathlib import Path

import pytest

import service
from service.cli import main
from service.counters import describe, registry
from service.errors import CounterError

GUIDE = Path(service.__file__).parent / "guide" / "counters.md"


def test_the_guide_has_the_tables_of_today():
    text = GUIDE.read_text("utf-8")
    assert text.endswith("\n\n" + describe.markdown()), "steplink counters --markdown prints them anew"


def test_every_parameter_has_its_values_range_unit_and_meaning():
    lines = {line[0]: line for line in describe.parameters("double_threshold")}
    assert lines["rest_raw"][1:5] == ("1", "5.75", "0 to 64", "raw units")
    assert lines["axes"][1:4] == ("xz", "norm", "xz or norm")
    assert all(line[-1] for name in registry.COUNTERS for line in describe.parameters(name))


def test_every_counter_names_its_source_and_latency():
    lines = {line[0]: line for line in describe.overview()}
    assert lines.keys() == registry.COUNTERS.keys()
    assert "Jayalath" in lines["gyro_zero_crossing"][3]
    assert lines["fusion"][1] == "accelerometer, gyroscope, magnetometer"
    tuned_s = registry.make("double_threshold").latency_s
    assert lines["double_threshold"][2].endswith(f", {tuned_s:.1f} s")


def test_an_unknown_counter_is_told():
    with pytest.raises(CounterError, match="there are steplink, double_threshold"):
        describe.parameters("abacus")


def test_the_command_prints_what_is_asked_for(capsys):
    assert main(["counters"]) == 0
    out = capsys.readouterr().out
    assert "plus_minus" in out
    assert "Wang, Peng, Zhou" in out
    assert max(map(len, out.splitlines())) <= 130
    assert main(["counters", "fusion"]) == 0
    assert "height_cm" in capsys.readouterr().out
    assert main(["counters", "abacus"]) == 2
    assert "abacus" in capsys.readouterr().err
