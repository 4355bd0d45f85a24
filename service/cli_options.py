"""Options of the commands, apart so that `service.cli` stays a list of what they do."""

from __future__ import annotations

import argparse
import dataclasses
import math
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from service.config import Settings
from service.errors import ParameterError

if TYPE_CHECKING:
    from service.recordings import ColumnMapping

DEFAULT_ID: Final = "sim-1"
DEFAULT_NAME: Final = "Steplink"
WRISTS: Final = {"sim-1": "Left", "sim-2": "Right"}
"""Name of each of two bracelets, by its id."""

SENSORS: Final = {"accelerometer": 1, "gyroscope": 2, "all": 3}
"""How many of `service.samples.Sensor` a bracelet has, in that order."""

DEFAULT_AIR: Final = "127.0.0.1:7400"
DEMO_WALK: Final = "normal:30,slow:20,rest:6,type:8,fast:20,run:15,rest:5"

ONE_DAY: Final = 4_320_000
"""Samples of a bench: a day at 50 Hz."""


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add an option for each of the service's settings."""
    for field in dataclasses.fields(Settings):
        meta = field.metadata
        span = f", {meta['low']:g}–{meta['high']:g} {meta['unit']}".rstrip() if meta["low"] is not None else ""
        repeated = isinstance(field.default, tuple)
        parser.add_argument(
            f"--{field.name.replace('_', '-')}",
            type=str if repeated else type(field.default),
            action="append" if repeated else "store",
            default=None if repeated else field.default,
            metavar=(meta["unit"] or "TEXT").upper(),
            help=f"{meta['text']}{span}" + ("" if field.default == "" else f" (default {_default(field.default)})"),
        )


def _default(value: object) -> str:
    return (" ".join(value) or "none") if isinstance(value, tuple) else str(value)


def add_air(parser: argparse.ArgumentParser) -> None:
    """Add the virtual radio in place of this machine's."""
    parser.add_argument(
        "--air",
        metavar="HOST:PORT",
        nargs="?",
        const=DEFAULT_AIR,
        help=f"use the virtual radio of `steplink sim` there ({DEFAULT_AIR}) instead of this machine's Bluetooth",
    )


def add_columns(parser: argparse.ArgumentParser) -> None:
    """Add how a table that is no format of ours is read."""
    parser.add_argument(
        "--columns",
        metavar="time=T,x=X,y=Y,z=Z",
        help="read texts as tables with these columns: names of the header, or numbers from 1; time may be missing"
        " where --rate-hz is given; gx, gy, gz (gyroscope), mx, my, mz (magnetometer, µT), steps (a 1 at each step, or"
        " their running number) may be named too",
    )
    parser.add_argument("--units", metavar="UNIT", help="with --columns: acceleration in g, mg or m/s2 (default g)")
    parser.add_argument("--time-unit", metavar="UNIT", help="with --columns: time in s, ms, us or ns (default s)")
    parser.add_argument(
        "--gyro-units", metavar="UNIT", help="with --columns: gyroscope in rad/s or deg/s (default rad/s)"
    )
    parser.add_argument(
        "--rate-hz",
        type=number(0.01, 10_000),
        metavar="HZ",
        help="samples a second, for files that hold neither time nor rate, 0.01–10000 Hz",
    )


def mapping(options: argparse.Namespace) -> ColumnMapping | None:
    """Return which columns texts have, None where the options do not say; ParameterError for units of none."""
    from service.recordings import column_mapping  # noqa: PLC0415

    units = {"units": options.units, "time-unit": options.time_unit, "gyro-units": options.gyro_units}
    given = {name: value for name, value in units.items() if value is not None}
    if options.columns is not None:
        return column_mapping(options.columns, options.units, options.time_unit, options.gyro_units)
    for name, value in given.items():
        raise ParameterError(
            name, value, "it is the unit of named columns: --columns time=t,x=ax,y=ay,z=az is wanted too"
        )
    return None


def add_bracelet(parser: argparse.ArgumentParser) -> None:
    """Add what a simulated bracelet is and plays."""
    parser.add_argument("--recording", metavar="FILE", help="play this recording; README lists the formats")
    add_columns(parser)
    parser.add_argument(
        "--lsb-per-g",
        type=number(1, 65535),
        default=32.0,
        help="scale of a recording in raw units, LSB/g (default 32)",
    )
    parser.add_argument(
        "--walk", default=DEMO_WALK, help=f"what a synthetic walker does, in s each (default {DEMO_WALK})"
    )
    parser.add_argument("--seed", type=int, default=1, help="another seed, another walker (default 1)")
    parser.add_argument(
        "--speed", type=number(0.01, math.inf), default=1.0, help="device seconds per second (default 1)"
    )
    parser.add_argument("--once", action="store_true", help="play once instead of for ever")
    parser.add_argument("--name", default=DEFAULT_NAME, help="advertised name, at most 8 bytes (default Steplink)")
    parser.add_argument("--id", default=DEFAULT_ID, help="the bracelet's own id, 1–20 bytes (default sim-1)")
    parser.add_argument(
        "--sensors",
        choices=tuple(SENSORS),
        default="accelerometer",
        help="what it measures: acceleration only, angular rate too, or all, the Earth's field with them; of a"
        " recording, what that has of them (default accelerometer)",
    )
    parser.add_argument(
        "--packet-samples",
        type=int,
        default=8,
        help="most samples of one packet; 0 fills the MTU, 8 at 50 Hz are 0.16 s (default 8)",
    )

    _add_hardware(parser)


def _add_hardware(parser: argparse.ArgumentParser) -> None:
    """Add what a simulated bracelet's clocks, memory and battery are like."""
    parser.add_argument(
        "--history-s",
        type=number(0, 600),
        default=600.0,
        help="seconds of samples it keeps and sends again when asked, 0–600 s, 0 none (default 600)",
    )
    parser.add_argument(
        "--drift-ppm",
        type=number(-10_000, 10_000),
        default=0.0,
        help="how fast its clock runs against true time, -10000–10000 ppm (default 0)",
    )
    parser.add_argument(
        "--sensor-ppm",
        type=number(-10_000, 10_000),
        default=0.0,
        help="how fast its sensor samples against that clock, -10000–10000 ppm: the rate's error (default 0)",
    )
    parser.add_argument(
        "--utc-offset-s",
        type=number(-86_400, 86_400),
        metavar="S",
        help="how far its own UTC is ahead, -86400–86400 s (default: it does not know the time until it is told)",
    )
    parser.add_argument(
        "--battery-hours",
        type=number(0.001, 100_000),
        metavar="H",
        help="how long its battery lasts from full to empty, 0.001–100000 h; then it is off (default for ever)",
    )
    parser.add_argument(
        "--encrypted",
        action="store_true",
        help="say and take nothing before it is paired with; the service does that by itself",
    )


def add_wrists(parser: argparse.ArgumentParser) -> None:
    """Add on how many wrists a walker wears a bracelet."""
    parser.add_argument(
        "--wrists",
        type=int,
        choices=(1, 2),
        default=1,
        help="bracelets on one synthetic walker's wrists; two are sim-1 Left and sim-2 Right, the same true steps"
        " (default 1)",
    )


def number(low: float, high: float) -> Callable[[str], float]:
    """Return a reader of numbers from `low` to `high`."""

    def read(text: str) -> float:
        value = float(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text} is not in {low:g}–{high:g}")
        return value

    return read


def add_evaluation(parser: argparse.ArgumentParser) -> None:
    """Add what `evaluate` takes."""
    parser.add_argument("path", metavar="PATH", nargs="*", help="a recording, or a folder that is searched through")
    add_columns(parser)
    _add_counter(parser, f"counters to evaluate, or all (default {Settings().counter})")
    parser.add_argument(
        "--preset", choices=("paper", "tuned"), help="their parameters (default tuned, with --paper the published ones)"
    )
    parser.add_argument(
        "--param",
        action="append",
        default=[],
        metavar="NAME.KEY=V",
        help="change one parameter of one counter, as in double_threshold.bout=3; may be repeated",
    )
    parser.add_argument(
        "--calibrate",
        metavar="WALK",
        help="let counters learn before they count: `middle`, each recording from its own middle 300 samples"
        " (double_threshold), or a file, a calibration walk (double_threshold, gyro_zero_crossing: as slow as ever)",
    )
    _add_weights(parser)
    _add_json(parser, "write a row for each recording and counter there")
    parser.add_argument(
        "--paper",
        metavar="NAME",
        help="print the tables of wang2018, chen2015, jayalath2013 or khedr2017, published figures beside ours, on"
        " synthetic walkers and on recordings of the same conditions (PATH, else those of STEPLINK_DATA)",
    )
    parser.add_argument(
        "--figures",
        metavar="DIR",
        help="draw the papers' figures and the agreement there, as PNG (extra: figures); with --scorecard its own, as"
        " SVG",
    )
    _add_scorecard(parser)
    cores = os.cpu_count() or 1
    parser.add_argument(
        "--jobs", type=_whole(1, 256), default=cores, help=f"recordings counted at once (default {cores}, the cores)"
    )
    parser.add_argument(
        "--lsb-per-g",
        type=_whole(1, 65535),
        default=32,
        help="scale of recordings in raw units, LSB/g (default 32)",
    )


def _add_scorecard(parser: argparse.ArgumentParser) -> None:
    """Add what makes an evaluation a scorecard."""
    parser.add_argument(
        "--scorecard",
        action="store_true",
        help="tell everything that is asked of a counter: families beside their limits, step-free clips between two"
        " walks, step times, disturbances, situations, what dominates the error",
    )
    parser.add_argument(
        "--split",
        metavar="NAME",
        default="dev",
        help="with --scorecard: recordings that an index.csv lists with another split are left out (default dev)",
    )
    parser.add_argument(
        "--guide",
        metavar="FILE",
        help="with --scorecard: write it there as a page of the guide (.md), its figures (.svg) beside it",
    )


def add_bench(parser: argparse.ArgumentParser) -> None:
    """Add what `bench` takes."""
    _add_counter(parser, "counters to measure, or all (default all)")
    _add_weights(parser)
    _add_json(parser, "write a list of {name, value, unit} there")
    parser.add_argument(
        "--samples",
        type=_whole(1000, 100_000_000),
        default=ONE_DAY,
        help=f"length of the signal at 50 Hz (default {ONE_DAY}, a day)",
    )


def _add_counter(parser: argparse.ArgumentParser, text: str) -> None:
    parser.add_argument("--counter", nargs="+", action="extend", default=[], metavar="NAME", help=text)


def _add_weights(parser: argparse.ArgumentParser) -> None:
    (field,) = (field for field in dataclasses.fields(Settings) if field.name == "weights")
    parser.add_argument("--weights", metavar="FILE", default="", help=field.metadata["text"])


def _add_json(parser: argparse.ArgumentParser, text: str) -> None:
    parser.add_argument("--json", metavar="FILE", help=text)


def _whole(low: int, high: int) -> Callable[[str], int]:
    def whole(text: str) -> int:
        value = int(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text} is not in {low}–{high}")
        return value

    return whole
