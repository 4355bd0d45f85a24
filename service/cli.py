"""The commands: `steplink demo`, `serve`, `scan`, `sim`, `forget`, `evaluate`, `bench`, `train`, `counters`.

Ctrl-C or SIGTERM ends each cleanly: with exit code 0 those that go on until they are told to end, with 130 or 143 those
whose result is then missing. A wrong option, file or port ends a command with one line and exit code 2; no Bluetooth
with one line and exit code 3; an evaluation without a single count, or a fine-tuning that did not help, with exit
code 1. Nothing heavy is imported before a command needs it.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import dataclasses
import logging
import signal
import sys
import tempfile
from collections.abc import Callable, Coroutine, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from service import cli_evaluation, cli_options, cli_training
from service.cli_output import say, spell_out
from service.cli_stop import Stopped, stopped_at_once, tell
from service.config import Settings
from service.errors import LinkError, ParameterError, SteplinkError, UnknownPersonError

if TYPE_CHECKING:
    from device_sim.bracelet import Bracelet
    from device_sim.gatt import GattBracelet
    from device_sim.source import Source
    from service.links.ble import Backend
    from service.pipeline.archive import Archive
    from service.pipeline.supervisor import Supervisor

USAGE_ERROR = 2
NO_BLUETOOTH = 3
STORE_NAME = "steplink.db"
QUEUE_BATCHES = 4096
"""Batches that may wait for the disk: four seconds of a thousand devices."""
BOOT_NS = 50_000_000
"""A simulated bracelet that starts again later than this has another boot number."""

Command = Callable[[argparse.Namespace], Coroutine[Any, Any, int | None]]


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code."""
    spell_out()
    options = _parser().parse_args(argv)
    logging.basicConfig(level=logging.WARNING, format="steplink: %(message)s")
    logging.getLogger("bumble").setLevel(logging.CRITICAL)  # what a lost link leaves behind is no news to a user
    try:
        _use_weights(options)
        if not options.endless:
            with stopped_at_once():
                return asyncio.run(options.command(options)) or 0
        return asyncio.run(_stoppable(options.command(options))) or 0
    except Stopped as stopped:
        tell()
        return stopped.code
    except (KeyboardInterrupt, asyncio.CancelledError):
        return 0
    except LinkError as error:
        print(f"steplink: {error}", file=sys.stderr)
        return NO_BLUETOOTH
    except SteplinkError as error:
        print(f"steplink: {error}", file=sys.stderr)
        return USAGE_ERROR


def _use_weights(options: argparse.Namespace) -> None:
    """Let all that a command counts be counted with the weights it names; ParameterError where they are none."""
    if "weights" in options:
        from service.counters import steplink_weights  # noqa: PLC0415

        steplink_weights.use(options.weights)


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
        path = worn.enter_context(_demo_store(settings))
        await _side_by_side(_serve_with(settings, backend, path), *(_take_off(one) for one in played))


@contextlib.contextmanager
def _demo_store(settings: Settings) -> Iterator[Path]:
    """Yield where a demo stores: in a folder that goes with it, unless a file is named."""
    if settings.store:
        yield Path(settings.store)
        return
    with tempfile.TemporaryDirectory(prefix="steplink-") as folder:
        yield Path(folder) / STORE_NAME


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
    say("the recording has been played; the bracelet leaves")
    await worn.go_away()


async def _serve(options: argparse.Namespace) -> None:
    """Run the service, over this machine's Bluetooth or a virtual air."""
    settings = _settings(options)
    async with _backend(options.air) as backend:
        await _serve_with(settings, backend, _store_path(settings), wanted=options.connect)


async def _scan(options: argparse.Namespace) -> None:
    """List the bracelets that are near."""
    from service.links.ble import find  # noqa: PLC0415
    from service.wearables.bracelet import Bracelet  # noqa: PLC0415

    async with _backend(options.air) as backend:
        print(f"scanning for {options.seconds:g} s …", file=sys.stderr)
        found = await find(Bracelet.services, for_s=options.seconds, backend=backend)
    say(f"{'address':<20} {'name':<12} {'signal':>8}")
    for sighting in found:
        say(f"{sighting.address:<20} {sighting.name or '–':<12} {sighting.rssi_dbm:>4} dBm")
    if not found:
        print("none found: is the bracelet on, near and not connected elsewhere?", file=sys.stderr)


async def _sim(options: argparse.Namespace) -> None:
    """Put a bracelet on a virtual air, for `steplink serve --air` in another terminal."""
    from device_sim.air_tcp import hosted_air  # noqa: PLC0415

    bracelet = _bracelet(options, options.id)
    async with hosted_air(options.air) as air, _on_air(air, bracelet, options.name, options) as played:
        say(f"bracelet {bracelet.device_id} is on the air at {options.air}; in another terminal:")
        say(f"    steplink serve --air {options.air}")
        await played.until_played()
        say("the recording has been played")


async def _serve_with(settings: Settings, backend: Backend, path: Path, *, wanted: Sequence[str] | None = None) -> None:
    from service.api.app import create_app  # noqa: PLC0415
    from service.api.server import address, listen, serve, spare_what_is_loaded  # noqa: PLC0415
    from service.pipeline.archive import Archive, Keep  # noqa: PLC0415
    from service.store.store import open_store  # noqa: PLC0415

    make_supervisor = _supervisor(settings, backend, wanted)
    keep = Keep(raw_days=settings.keep_raw_days, raw_mb=settings.keep_raw_mb, log_days=settings.keep_log_days)
    with contextlib.closing(listen(settings.host, settings.port)) as bound:
        url = address(bound)

        def ready() -> None:
            spare_what_is_loaded()
            say(f"steplink {version('steplink')} is at {url}  (Ctrl-C ends it)")

        async with open_store(path, queue_batches=QUEUE_BATCHES) as store:
            await serve(create_app(make_supervisor(Archive(store, keep))), bound, on_ready=ready)


def _store_path(settings: Settings) -> Path:
    """Return where the service stores: the file that is named, or one in the user's data folder."""
    from platformdirs import user_data_path  # noqa: PLC0415

    return Path(settings.store) if settings.store else user_data_path("steplink", appauthor=False) / STORE_NAME


async def _forget(options: argparse.Namespace) -> None:
    """Delete a person's data, while no service runs on the store."""
    from service.store.store import open_store  # noqa: PLC0415

    path = Path(options.store) if options.store else _store_path(Settings())
    if not path.exists():
        raise ParameterError("store", str(path), "there is no such file")
    async with open_store(path, queue_batches=1) as store:
        sessions = await store.forget(options.person)
    if not sessions:
        raise UnknownPersonError(options.person)
    say(f"{sessions} sessions of {options.person} were deleted for good")


def _supervisor(settings: Settings, backend: Backend, wanted: Sequence[str] | None) -> Callable[[Archive], Supervisor]:
    """Return what makes the supervisor over a store; wrong options are refused now."""
    from service.pipeline.hub import Hub  # noqa: PLC0415
    from service.pipeline.lineup import lineup  # noqa: PLC0415
    from service.pipeline.supervisor import Supervisor  # noqa: PLC0415
    from service.wearables.bracelet import Bracelet  # noqa: PLC0415

    counters = lineup(settings.counter, beside=settings.beside, preset=settings.preset, params=settings.param)
    return lambda archive: Supervisor(
        hub=Hub(durable_limit=settings.durable_limit),
        make_wearable=Bracelet,
        lineup=counters,
        wanted=wanted or None,
        backend=backend,
        archive=archive,
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
    device: GattBracelet = air.bracelet(
        bracelet, name=name, speed=options.speed, start=start, encrypted=options.encrypted
    )
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

    offset_s = options.utc_offset_s
    # Boots count upwards for ever; a simulated bracelet keeps no flash memory, so the clock counts for it.
    return Bracelet(
        _source(options, mirrored=mirrored),
        device_id=device,
        boot=time.time_ns() // BOOT_NS & 0xFFFFFFFF,
        packet_samples=options.packet_samples,
        history_s=options.history_s,
        drift_ppm=options.drift_ppm,
        sensor_ppm=options.sensor_ppm,
        battery_hours=options.battery_hours,
        utc_ms=None if offset_s is None else time.time_ns() // 1_000_000 + round(offset_s * 1000),
    )


def _source(options: argparse.Namespace, *, mirrored: bool) -> Source:
    from device_sim.source import RecordingSource, WalkerSource  # noqa: PLC0415
    from service.samples import Sensor  # noqa: PLC0415

    sensors = tuple(Sensor)[: cli_options.SENSORS[options.sensors]]
    if options.recording is None:
        return WalkerSource(options.walk, seed=options.seed, loop=not options.once, sensors=sensors, mirrored=mirrored)
    from service.recordings import read  # noqa: PLC0415

    recording = read(
        options.recording, lsb_per_g=options.lsb_per_g, mapping=cli_options.mapping(options), rate_hz=options.rate_hz
    )
    source = RecordingSource(recording, loop=not options.once, sensors=sensors)
    if absent := [sensor for sensor in sensors if sensor not in source.sensors]:
        print(f"steplink: {options.recording} holds nothing of a {' or '.join(absent)}", file=sys.stderr)
    return source


def _settings(options: argparse.Namespace) -> Settings:
    given = {field.name: getattr(options, field.name) for field in dataclasses.fields(Settings)}
    return Settings(**{name: value for name, value in given.items() if value is not None})


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="steplink", description="Live step counts of Bluetooth LE wearables.")
    parser.add_argument("--version", action="version", version=f"steplink {version('steplink')}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    demo = _command(
        commands, "demo", _demo, "see it work: a simulated bracelet, its radio and the service in one", endless=True
    )
    cli_options.add_settings(demo)
    cli_options.add_bracelet(demo)
    cli_options.add_wrists(demo)
    serve = _command(commands, "serve", _serve, "run the service", endless=True)
    cli_options.add_settings(serve)
    cli_options.add_air(serve)
    serve.add_argument(
        "--connect",
        action="append",
        metavar="NAME",
        help="connect to the device of this name or address only, and again after each loss; may be repeated"
        " (default: every bracelet heard)",
    )
    scan = _command(commands, "scan", _scan, "list the bracelets that are near", endless=True)
    scan.add_argument(
        "--seconds", type=cli_options.number(0.1, 600), default=5.0, help="how long to listen, 0.1–600 s (default 5)"
    )
    cli_options.add_air(scan)
    sim = _command(
        commands, "sim", _sim, "run a simulated bracelet for `serve --air` in another terminal", endless=True
    )
    sim.add_argument(
        "--air",
        metavar="HOST:PORT",
        default=cli_options.DEFAULT_AIR,
        help=f"where its radio is (default {cli_options.DEFAULT_AIR})",
    )
    cli_options.add_bracelet(sim)
    forget = _command(commands, "forget", _forget, "delete all data of a person from the store, for good")
    forget.add_argument("person", metavar="PERSON", help="whose: as named by PUT /api/v1/devices/{id}/person")
    forget.add_argument("--store", metavar="FILE", help="the database (default: as of `serve`); no service may use it")
    evaluate = _command(
        commands, "evaluate", cli_evaluation.evaluate, "count recordings and compare with their true steps"
    )
    cli_options.add_evaluation(evaluate)
    bench = _command(commands, "bench", cli_evaluation.bench, "measure how fast the counters are")
    cli_options.add_bench(bench)
    train = _command(
        commands, "train", cli_training.train, "train the network of the counter steplink, or fine-tune it"
    )
    cli_training.add_options(train)
    counters = _command(commands, "counters", cli_evaluation.counters, "list the counters, or the parameters of one")
    counters.add_argument("name", metavar="NAME", nargs="?", help="a counter, whose parameters are then listed")
    counters.add_argument("--markdown", action="store_true", help="print all tables as the guide has them")
    return parser


def _command(
    commands: Any,  # noqa: ANN401
    name: str,
    command: Command,
    text: str,
    *,
    endless: bool = False,
) -> argparse.ArgumentParser:
    """Add a command; an endless one goes on until it is told to end, so that Ctrl-C is no failure of it."""
    parser: argparse.ArgumentParser = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
    parser.set_defaults(command=command, endless=endless)
    return parser


if __name__ == "__main__":
    sys.exit(main())
