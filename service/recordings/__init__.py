"""Recordings on disk: what acceleration was measured, when, and how many steps it truly holds.

`read` takes any known format, `write_csv` writes the one that people and spreadsheets can read. Nothing here counts.
"""

from service.recordings.csv_file import write_csv
from service.recordings.even import evenly_spaced, stated_rate_hz
from service.recordings.formats import is_recording, read, suffixes
from service.recordings.mapped_file import ColumnMapping, TimeUnit, Unit, column_mapping
from service.recordings.recording import Recording

__all__ = [
    "ColumnMapping",
    "Recording",
    "TimeUnit",
    "Unit",
    "column_mapping",
    "evenly_spaced",
    "is_recording",
    "read",
    "stated_rate_hz",
    "suffixes",
    "write_csv",
]
