"""Options of `steplink evaluate` and `steplink bench`, apart so that `service.cli` stays a list of commands."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from typing import Final

ONE_DAY: Final = 4_320_000
"""Samples of a bench: a day at 50 Hz."""


def add_evaluation(parser: argparse.ArgumentParser) -> None:
    """Add what `evaluate` takes."""
    parser.add_argument("path", metavar="PATH", nargs="*", help="a recording, or a folder that is searched through")
    _add_counter(parser, "counters to evaluate, or all (default double_threshold)")
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
    _add_json(parser, "write a row for each recording and counter there")
    parser.add_argument(
        "--paper",
        metavar="NAME",
        help="print the tables of wang2018, chen2015, jayalath2013 or khedr2017, published figures beside ours, on"
        " synthetic walkers and on recordings of the same conditions (PATH, else those of STEPLINK_DATA)",
    )
    parser.add_argument(
        "--figures", metavar="DIR", help="draw the papers' figures and the agreement there, as PNG (extra: figures)"
    )
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


def add_bench(parser: argparse.ArgumentParser) -> None:
    """Add what `bench` takes."""
    _add_counter(parser, "counters to measure, or all (default all)")
    _add_json(parser, "write a list of {name, value, unit} there")
    parser.add_argument(
        "--samples",
        type=_whole(1000, 100_000_000),
        default=ONE_DAY,
        help=f"length of the signal at 50 Hz (default {ONE_DAY}, a day)",
    )


def _add_counter(parser: argparse.ArgumentParser, text: str) -> None:
    parser.add_argument("--counter", nargs="+", action="extend", default=[], metavar="NAME", help=text)


def _add_json(parser: argparse.ArgumentParser, text: str) -> None:
    parser.add_argument("--json", metavar="FILE", help=text)


def _whole(low: int, high: int) -> Callable[[str], int]:
    def whole(text: str) -> int:
        value = int(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text} is not in {low}–{high}")
        return value

    return whole
