"""The commands: `steplink demo`, `serve`, `scan`, `sim`, `evaluate`, `bench`, `counters`.

Ctrl-C or SIGTERM ends each cleanly with exit code 0; a wrong option, file or port ends it with one line and exit code
2; no Bluetooth with one line and exit code 3; an evaluation without a single count with exit code 1. Nothing heavy is
imported before a command needs it.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import dataclasses
import logging
import signal
import sys
from collections.abc import Callable, Coroutine, Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from service import cli_options
from service.config import Settings
from service.errors import LinkError, ParameterError, SteplinkError

if TYPE_CHECKING:
    from pathlib import Path

    from device_sim.bracelet import Bracelet
    from device_sim.gatt import GattBracelet
    from device_sim.source import Source
    from service.evaluation.choices import Found
    from service.evaluation.papers.report import Bar
    from service.evaluation.rows import Row
    from service.links.ble import Backend
    from service.pipeline.supervisor import Supervisor
    from service.recordings import ColumnMapping

NOTHING_COUNTED = 1
USAGE_ERROR = 2
NO_BLUETOOTH = 3
BOOT_NS = 50_000_000
"""A simulated bracelet that starts again later than this has another boot number."""

Command = Callable[[argparse.Namespace], Coroutine[Any, Any, int | None]]


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code."""
    options = _parser().parse_args(argv)
    logging.basicConfig(level=logging.WARNING, format="steplink: %(message)s")
    logging.getLogger("bumble").setLevel(logging.CRITICAL)  # what a lost link leaves behind is no news to a user
    try:
        return asyncio.run(_stoppable(options.command(options))) or 0
    except (KeyboardInterrupt, asyncio.CancelledError):
        return 0
    except LinkError as error:
        print(f"steplink: {error}", file=sys.stderr)
        return NO_BLUETOOTH
    except SteplinkError as error:
        print(f"steplink: {error}", file=sys.stderr)
        return USAGE_ERROR


async def _stoppable(work: Coroutine[Any, Any, int | None]) -> int | None:
    """Await `work`; SIGTERM cancels it as Ctrl-C does."""
    task = asyncio.current_task()
    if task is not None:
        with contextlib.suppress(NotImplementedError):  # Windows has no signal handlers on its loop
            asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
    return await work


async def _demo(options: argparse.Namespace) -> None:
    """Run a bracelet, a radio and the service in this process."""
    from device_sim.air import LocalAir  # noqa: PLC0415
    from service.links.ble import Backend  # noqa: PLC0415

    settings = _settings(options)
    bracelets = _bracelets(options)
    async with LocalAir() as air, contextlib.AsyncExitStack() as worn:
        played = [
            await worn.enter_async_context(_on_air(air, bracelet, name, options))
            for name, bracelet in bracelets.items()
        ]
        central = await worn.enter_async_context(air.central())
        backend = Backend(scanner=central.scanner, client=central.client)
        await _side_by_side(
            _serve_with(settings, _supervisor(settings, backend, wanted=None)), *(_take_off(one) for one in played)
        )


async def _side_by_side(*works: Coroutine[Any, Any, None]) -> None:
    """Run all until they have ended; the first failure ends the others and is raised."""
    tasks = [asyncio.create_task(work) for work in works]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_EXCEPTION)
        for task in done:
            task.result()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _take_off(worn: GattBracelet) -> None:
    """Take a bracelet that has nothing more to play off the air."""
    await worn.until_played()
    print("the recording has been played; the bracelet leaves", flush=True)
    await worn.go_away()


async def _serve(options: argparse.Namespace) -> None:
    """Run the service, over this machine's Bluetooth or a virtual air."""
    settings = _settings(options)
    async with _backend(options.air) as backend:
        await _serve_with(settings, _supervisor(settings, backend, wanted=options.connect))


async def _scan(options: argparse.Namespace) -> None:
    """List the bracelets that are near."""
    from service.links.ble import find  # noqa: PLC0415
    from service.wearables.bracelet import Bracelet  # noqa: PLC0415

    async with _backend(options.air) as backend:
        print(f"scanning for {options.seconds:g} s …", file=sys.stderr)
        found = await find(Bracelet.services, for_s=options.seconds, backend=backend)
    print(f"{'address':<20} {'name':<12} {'signal':>8}")
    for sighting in found:
        print(f"{sighting.address:<20} {sighting.name or '–':<12} {sighting.rssi_dbm:>4} dBm")
    if not found:
        print("none found: is the bracelet on, near and not connected elsewhere?", file=sys.stderr)


async def _sim(options: argparse.Namespace) -> None:
    """Put a bracelet on a virtual air, for `steplink serve --air` in another terminal."""
    from device_sim.air_tcp import hosted_air  # noqa: PLC0415

    bracelet = _bracelet(options, options.id)
    async with hosted_air(options.air) as air, _on_air(air, bracelet, options.name, options) as played:
        print(f"bracelet {bracelet.device_id} is on the air at {options.air}; in another terminal:", flush=True)
        print(f"    steplink serve --air {options.air}", flush=True)
        await played.until_played()
        print("the recording has been played")


async def _evaluate(options: argparse.Namespace) -> int:
    """Count recordings and compare with their true steps."""
    from service.evaluation import choices, json_file  # noqa: PLC0415
    from service.evaluation.progress import ProgressBar  # noqa: PLC0415
    from service.evaluation.run import evaluate  # noqa: PLC0415
    from service.evaluation.tables import report  # noqa: PLC0415

    if options.paper is not None:
        await _evaluate_paper(options)
        return 0
    names, paths = choices.counters_and_paths(options.counter, options.path)
    chosen = choices.choices(names, options.preset or "tuned", options.param)
    found, passed = choices.find(paths, _mapping(options))
    output, folder = json_file.checked_path(options.json), _figures_folder(options)
    if passed:
        print(f"steplink: passed over texts without acceleration: {', '.join(passed)}", file=sys.stderr)
    with ProgressBar() as progress:
        rows = await evaluate(found, chosen, jobs=options.jobs, lsb_per_g=options.lsb_per_g, progress=progress)
    print(report(rows))
    json_file.write_json(output, (row.as_json() for row in rows))
    await _draw(folder, rows, found, options)
    return NOTHING_COUNTED if all(row.error for row in rows) else 0


async def _evaluate_paper(options: argparse.Namespace) -> None:
    """Print a paper's tables, its figures beside ours."""
    from service.evaluation import json_file  # noqa: PLC0415
    from service.evaluation.papers import run  # noqa: PLC0415
    from service.evaluation.progress import ProgressBar  # noqa: PLC0415

    asked = run.asked(options.paper, options.counter, options.param)
    found = run.recordings(options.path)
    output, folder = json_file.checked_path(options.json), _figures_folder(options)
    with ProgressBar() as progress:
        made = await run.report(
            asked,
            found,
            options.preset or run.PRESET,
            jobs=options.jobs,
            lsb_per_g=options.lsb_per_g,
            progress=progress,
        )
    print(made.text())
    json_file.write_json(output, made.as_json())
    await _draw(folder, made.rows, found, options, made.bars)


def _figures_folder(options: argparse.Namespace) -> Path | None:
    from service.evaluation.figures.canvas import checked_folder  # noqa: PLC0415

    return None if options.figures is None else checked_folder(options.figures)


async def _draw(
    folder: Path | None,
    rows: Sequence[Row],
    found: Sequence[Found],
    options: argparse.Namespace,
    bars: Sequence[Bar] = (),
) -> None:
    """Draw the figures where a folder for them was named."""
    if folder is None:
        return
    from service.evaluation.figures.draw import write  # noqa: PLC0415

    written = await asyncio.to_thread(write, folder, rows, found, lsb_per_g=options.lsb_per_g, bars=bars)
    print(f"steplink: {len(written)} figures in {folder}: {', '.join(path.stem for path in written)}", file=sys.stderr)


async def _bench(options: argparse.Namespace) -> None:
    """Measure the counters' speed."""
    from service.evaluation import bench, choices, json_file  # noqa: PLC0415
    from service.signals.compiled import available  # noqa: PLC0415

    names = [choice.counter for choice in choices.choices(options.counter or ["all"], "tuned", ())]
    output = json_file.checked_path(options.json)
    if not available():
        print(bench.WITHOUT_NUMBA, file=sys.stderr)
    figures = []
    for figure in bench.figures(names, options.samples):
        print(f"{figure.name:<58}{figure.value:>15,.4g} {figure.unit}", flush=True)
        figures.append(dataclasses.asdict(figure))
        await asyncio.sleep(0)  # Ctrl-C is heeded here
    json_file.write_json(output, figures)


async def _counters(options: argparse.Namespace) -> None:
    """Print the counters, or the parameters of one."""
    from service.counters import describe  # noqa: PLC0415
    from service.evaluation.tables import aligned  # noqa: PLC0415

    if options.markdown:
        print(describe.markdown(), end="")
    elif options.name is None:
        print(aligned([describe.OVERVIEW, *describe.overview()], left=4))
    else:
        print(aligned([describe.PARAMETERS, *describe.parameters(options.name)], left=6))


async def _serve_with(settings: Settings, supervisor: Supervisor) -> None:
    from service.api.app import create_app  # noqa: PLC0415
    from service.api.server import address, listen, serve  # noqa: PLC0415

    bound = listen(settings.host, settings.port)
    url = address(bound)

    def ready() -> None:
        print(f"steplink {version('steplink')} is at {url}  (Ctrl-C ends it)", flush=True)

    await serve(create_app(supervisor), bound, on_ready=ready)


def _supervisor(settings: Settings, backend: Backend, wanted: Sequence[str] | None) -> Supervisor:
    from service.pipeline.hub import Hub  # noqa: PLC0415
    from service.pipeline.lineup import lineup  # noqa: PLC0415
    from service.pipeline.supervisor import Supervisor  # noqa: PLC0415
    from service.wearables.bracelet import Bracelet  # noqa: PLC0415

    return Supervisor(
        hub=Hub(durable_limit=settings.durable_limit),
        make_wearable=Bracelet,
        lineup=lineup(settings.counter, beside=settings.beside, preset=settings.preset, params=settings.param),
        wanted=wanted or None,
        backend=backend,
    )


@contextlib.asynccontextmanager
async def _backend(air: str | None) -> Any:  # noqa: ANN401
    """Yield bleak's backend: the platform's own, or a central on the virtual air at `air`."""
    from service.links.ble import PLATFORM, Backend  # noqa: PLC0415

    if air is None:
        yield PLATFORM
        return
    from device_sim.air_tcp import remote_central  # noqa: PLC0415

    async with remote_central(air) as central:
        yield Backend(scanner=central.scanner, client=central.client)


def _on_air(air: Any, bracelet: Bracelet, name: str, options: argparse.Namespace) -> GattBracelet:  # noqa: ANN401
    from device_sim.gatt import Start  # noqa: PLC0415

    start = Start.ON_SUBSCRIBE if options.recording or options.once else Start.POWER_ON
    device: GattBracelet = air.bracelet(bracelet, name=name, speed=options.speed, start=start)
    return device


def _bracelets(options: argparse.Namespace) -> dict[str, Bracelet]:
    """Return what is worn, by advertised name: one bracelet, or one on each wrist of the same walker."""
    if options.wrists == 1:
        return {options.name: _bracelet(options, options.id)}
    if options.recording is not None:
        raise ParameterError("wrists", options.wrists, "a recording is of one wrist: leave --recording out")
    if (options.name, options.id) != (cli_options.DEFAULT_NAME, cli_options.DEFAULT_ID):
        raise ParameterError("wrists", options.wrists, "two bracelets have names and ids of their own")
    wrists = cli_options.WRISTS.items()
    return {name: _bracelet(options, device, mirrored=place > 0) for place, (device, name) in enumerate(wrists)}


def _bracelet(options: argparse.Namespace, device: str, *, mirrored: bool = False) -> Bracelet:
    import time  # noqa: PLC0415

    from device_sim.bracelet import Bracelet  # noqa: PLC0415

    # Boots count upwards for ever; a simulated bracelet keeps no flash memory, so the clock counts for it.
    return Bracelet(
        _source(options, mirrored=mirrored),
        device_id=device,
        boot=time.time_ns() // BOOT_NS & 0xFFFFFFFF,
        packet_samples=options.packet_samples,
    )


def _source(options: argparse.Namespace, *, mirrored: bool) -> Source:
    from device_sim.source import RecordingSource, WalkerSource  # noqa: PLC0415
    from service.samples import Sensor  # noqa: PLC0415

    sensors = tuple(Sensor)[: cli_options.SENSORS[options.sensors]]
    if options.recording is None:
        return WalkerSource(options.walk, seed=options.seed, loop=not options.once, sensors=sensors, mirrored=mirrored)
    from service.recordings import read  # noqa: PLC0415

    recording = read(options.recording, lsb_per_g=options.lsb_per_g, mapping=_mapping(options))
    source = RecordingSource(recording, loop=not options.once, sensors=sensors)
    if absent := [sensor for sensor in sensors if sensor not in source.sensors]:
        print(f"steplink: {options.recording} holds nothing of a {' or '.join(absent)}", file=sys.stderr)
    return source


def _mapping(options: argparse.Namespace) -> ColumnMapping | None:
    from service.recordings import column_mapping  # noqa: PLC0415

    return None if options.columns is None else column_mapping(options.columns, options.units, options.time_unit)


def _settings(options: argparse.Namespace) -> Settings:
    return Settings(**{field.name: getattr(options, field.name) for field in dataclasses.fields(Settings)})


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="steplink", description="Live step counts of Bluetooth LE wearables.")
    parser.add_argument("--version", action="version", version=f"steplink {version('steplink')}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    demo = _command(commands, "demo", _demo, "see it work: a simulated bracelet, its radio and the service in one")
    cli_options.add_settings(demo)
    cli_options.add_bracelet(demo)
    cli_options.add_wrists(demo)
    serve = _command(commands, "serve", _serve, "run the service")
    cli_options.add_settings(serve)
    cli_options.add_air(serve)
    serve.add_argument(
        "--connect",
        action="append",
        metavar="NAME",
        help="connect to the device of this name or address only, and again after each loss; may be repeated"
        " (default: every bracelet heard)",
    )
    scan = _command(commands, "scan", _scan, "list the bracelets that are near")
    scan.add_argument(
        "--seconds", type=cli_options.number(0.1, 600), default=5.0, help="how long to listen, 0.1–600 s (default 5)"
    )
    cli_options.add_air(scan)
    sim = _command(commands, "sim", _sim, "run a simulated bracelet for `serve --air` in another terminal")
    sim.add_argument(
        "--air",
        metavar="HOST:PORT",
        default=cli_options.DEFAULT_AIR,
        help=f"where its radio is (default {cli_options.DEFAULT_AIR})",
    )
    cli_options.add_bracelet(sim)
    evaluate = _command(commands, "evaluate", _evaluate, "count recordings and compare with their true steps")
    cli_options.add_evaluation(evaluate)
    bench = _command(commands, "bench", _bench, "measure how fast the counters are")
    cli_options.add_bench(bench)
    counters = _command(commands, "counters", _counters, "list the counters, or the parameters of one")
    counters.add_argument("name", metavar="NAME", nargs="?", help="a counter, whose parameters are then listed")
    counters.add_argument("--markdown", action="store_true", help="print all tables as the guide has them")
    return parser


def _command(commands: Any, name: str, command: Command, text: str) -> argparse.ArgumentParser:  # noqa: ANN401
    parser: argparse.ArgumentParser = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
    parser.set_defaults(command=command)
    return parser


if __name__ == "__main__":
    sys.exit(main())
