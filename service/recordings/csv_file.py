"""CSV with a header: a column a quantity, the unit in its name, so that nobody has to guess.

    # rate_hz: 50
    # true_steps: 2
    # step_t_s: 0.52 1.08
    # placement: wrist
    time_s,x_g,y_g,z_g
    0.00,0.01,-0.02,0.99
    0.02,0.02,-0.02,1.01

`x_g,y_g,z_g` must be there; `time_s` (seconds) or a rate, in the file or declared by the caller, too. Optional are
`gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s` and `mag_x_ut,mag_y_ut,mag_z_ut`. Other columns are ignored. The lines of
`# key: value` before the header are optional: `rate_hz`, `true_steps`, `steps_range` (`80 120`: from 80 to 120),
`step_t_s` (blanks between), `placement`, `activity`, `subject`, `quality`. UTF-8, decimal points, commas between
columns.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from service.errors import RecordingError
from service.recordings.recording import AXES, Floats, Recording, median_rate_hz, merge_repeated_stamps
from service.recordings.text_table import header_cells, is_number, numbers, read_lines

TIME = "time_s"
ACC = tuple(f"{axis}_g" for axis in AXES)
GYRO = tuple(f"gyro_{axis}_rad_s" for axis in AXES)
MAG = tuple(f"mag_{axis}_ut" for axis in AXES)
TEXTS = ("placement", "activity", "subject", "quality")


def recognises(head: bytes) -> bool:
    """Tell whether a file that begins with `head` is text."""
    return b"\0" not in head


def names_acceleration(head: bytes) -> bool:
    """Tell whether the header in `head`, the first line that is no comment, names a column of acceleration."""
    lines = (line.strip() for line in head.decode("latin-1").lower().split("\n"))
    header = next((line for line in lines if line and not line.startswith("#")), "")
    return any(name.strip().strip('"') in ACC for name in header.removeprefix("ï»¿").split(","))


def read_csv(path: Path, *, lsb_per_g: float, rate_hz: float | None) -> Recording:  # noqa: ARG001
    """Read a CSV; it holds g, so `lsb_per_g` says nothing. `rate_hz` is used where the file has neither time nor rate.

    RecordingError names the line and the column.
    """
    about, columns, first, lines = _split(path)
    wanted = [name for name in (TIME, *ACC, *GYRO, *MAG) if name in columns]
    absent = [name for name in ACC if name not in columns]
    if absent:
        raise RecordingError(
            str(path),
            f"line {first - 1}: no column {', '.join(absent)}; the header must be {TIME},{','.join(ACC)}"
            ", or the columns be named with --columns",
        )
    table = numbers(path, lines, first=first, wanted=[columns.index(name) for name in wanted], names=columns)
    group = {name: table[:, wanted.index(name)] for name in wanted}
    rate = _declared_rate(path, about) or rate_hz
    t_s = _time(path, group, rate, len(table))
    t_s, (acc_g, gyro_rad_s, mag_ut) = merge_repeated_stamps(
        t_s, *(_triple(group, names) for names in (ACC, GYRO, MAG))
    )
    assert acc_g is not None  # noqa: S101  # its columns were checked
    return Recording(
        path=path,
        t_s=t_s,
        acc_g=acc_g,
        rate_hz=rate or median_rate_hz(t_s),
        gyro_rad_s=gyro_rad_s,
        mag_ut=mag_ut,
        step_t_s=_step_times(path, about),
        true_steps=_true_steps(path, about),
        steps_range=_steps_range(path, about),
        placement=about.get("placement"),
        activity=about.get("activity"),
        subject=about.get("subject"),
        quality=about.get("quality"),
    )


def write_csv(recording: Recording, path: str | Path) -> None:
    """Write `recording` so that `read` gives back the same numbers, bit for bit.

    In texts, white space and control characters become one blank.
    """
    texts = {name: getattr(recording, name) for name in TEXTS}
    about: dict[str, object] = {"rate_hz": float(recording.rate_hz), "true_steps": recording.true_steps}
    if recording.steps_range is not None:
        about["steps_range"] = " ".join(map(str, recording.steps_range))
    if recording.step_t_s is not None:
        about["step_t_s"] = " ".join(map(repr, recording.step_t_s.tolist()))
    about |= {name: _folded(text) for name, text in texts.items() if text is not None}
    names, blocks = [TIME, *ACC], [recording.t_s[:, None], recording.acc_g]
    for triple, values in ((GYRO, recording.gyro_rad_s), (MAG, recording.mag_ut)):
        if values is not None:
            names += triple
            blocks.append(values)
    with Path(path).open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(f"# {key}: {value}\n" for key, value in about.items() if value is not None)
        file.write(",".join(names) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in np.hstack(blocks).tolist())


def _folded(text: str) -> str:
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


def _split(path: Path) -> tuple[dict[str, str], list[str], int, list[str]]:
    """Return the comments, the header's names, the number of the first line of data, and the lines of data."""
    lines = read_lines(path)
    about: dict[str, str] = {}
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if text.startswith("#"):
            key, _, value = text[1:].partition(":")
            about[key.strip()] = value.strip()
        elif text:
            return about, header_cells(text), number + 1, lines[number:]
    raise RecordingError(str(path), f"no header; the first line must be {TIME},{','.join(ACC)}")


def _declared_rate(path: Path, about: dict[str, str]) -> float | None:
    if "rate_hz" not in about:
        return None
    text = about["rate_hz"]
    if not is_number(text) or float(text) <= 0:
        raise RecordingError(str(path), f"# rate_hz: {text!r} is no rate above 0")
    return float(text)


def _time(path: Path, group: dict[str, Floats], rate_hz: float | None, n: int) -> Floats:
    if TIME in group:
        return group[TIME]
    if rate_hz is None:
        raise RecordingError(str(path), f"no column {TIME} and no rate; add '# rate_hz: 50' above the header")
    return np.arange(n) / rate_hz


def _triple(group: dict[str, Floats], names: tuple[str, ...]) -> Floats | None:
    if not all(name in group for name in names):
        return None
    return np.column_stack([group[name] for name in names])


def _step_times(path: Path, about: dict[str, str]) -> Floats | None:
    if "step_t_s" not in about:
        return None
    cells = about["step_t_s"].split()
    wrong = [cell for cell in cells if not is_number(cell)]
    if wrong:
        raise RecordingError(str(path), f"# step_t_s: {wrong[0]!r} is no time; seconds with blanks between are wanted")
    return np.array([float(cell) for cell in cells], dtype=np.float64)


def _true_steps(path: Path, about: dict[str, str]) -> int | None:
    text = about.get("true_steps")
    if text is None:
        return None
    if not text.isdecimal():
        raise RecordingError(str(path), f"# true_steps: {text!r} is no whole number")
    return int(text)


def _steps_range(path: Path, about: dict[str, str]) -> tuple[int, int] | None:
    text = about.get("steps_range")
    if text is None:
        return None
    cells = text.split()
    if len(cells) != 2 or not all(cell.isdecimal() for cell in cells):
        raise RecordingError(str(path), f"# steps_range: {text!r}; two whole numbers with a blank between are wanted")
    return int(cells[0]), int(cells[1])
