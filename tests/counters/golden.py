"""The expected counts of the real recordings are data: a table beside this file, a column for each counter.

Counts are those of the preset `tuned` over the development split; a counter that needs a sensor which a recording
lacks has none there. A counter that is missing in the table is not counted.
"""

import csv
from pathlib import Path

from service.counters import registry
from service.evaluation.counting import count, grid_block, sensors
from service.recordings import read

TABLE = Path(__file__).with_name("golden_counts.csv")
KEYS = ("dataset", "recording", "true")
SPLIT = "dev"
SHOWN = 40
"""Lines of a difference; more are counted only."""


def listed(folder):
    """Return the (dataset, recording, true steps) that may be looked at, in the index's order."""
    with (folder / "index.csv").open(encoding="utf-8") as index:
        rows = [row for row in csv.DictReader(index) if row["split"] == SPLIT]
    return [(row["dataset"], row["recording"], row["true_steps"]) for row in rows]


def counted(folder, names):
    """Return a row of the table for each recording, counted now by the counters of these names."""
    rows = []
    for dataset, recording, true in listed(folder):
        block = grid_block(read(folder / dataset / f"{recording}.npz"))
        has = sensors(block)
        steps = {name: str(count(block, name).steps) if registry.kind(name).sensors <= has else "" for name in names}
        rows.append(dict(zip(KEYS, (dataset, recording, true), strict=True)) | steps)
    return rows


def expected():
    """Return the table's rows."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def write(rows):
    """Write the table anew."""
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


def differences(old, new):
    """Return, a line each, what differs: a count with how far it was and is from the truth, a recording that is new."""
    before = {(row["dataset"], row["recording"]): row for row in old}
    now = {(row["dataset"], row["recording"]): row for row in new}
    lines = [f"- {'/'.join(key)}: is not listed any more" for key in before if key not in now]
    for key, row in now.items():
        if key not in before:
            lines.append(f"+ {'/'.join(key)}: is new")
            continue
        for name in (name for name in row if name not in KEYS[:2] and row[name] != before[key].get(name)):
            told = f"{before[key].get(name) or 'none'} → {row[name] or 'none'}"
            lines.append(f"± {'/'.join(key)}: {name} {told} (true {row['true']})")
    if len(lines) > SHOWN:
        lines[SHOWN:] = [f"… and {len(lines) - SHOWN} more"]
    return lines
