"""The database's tables, as the ordered steps that make them: step n leads from version n − 1 to n.

A step that has been released is never edited; a change is a new one. Raw samples lie by session, sensor and place, so
that a day of one sensor is read from neighbouring pages though a thousand devices were recorded at once; a row stays
below 1,002 bytes, beyond which SQLite would give each a page of its own.
"""

from __future__ import annotations

from typing import Final

APPLICATION_ID: Final = 0x53544550
"""Marks the file as ours: "STEP"."""

_VERSION_1 = (
    """
    CREATE TABLE persons (
        id INTEGER PRIMARY KEY,
        name TEXT NOT NULL UNIQUE,
        forgotten INTEGER NOT NULL DEFAULT 0  -- 1 while their data are being deleted
    ) STRICT
    """,
    """
    CREATE TABLE devices (
        id INTEGER PRIMARY KEY,
        name TEXT NOT NULL UNIQUE,
        person INTEGER REFERENCES persons (id),
        last_ordinal INTEGER NOT NULL DEFAULT 0
    ) STRICT
    """,
    "CREATE INDEX devices_by_person ON devices (person)",
    """
    CREATE TABLE sessions (
        id INTEGER PRIMARY KEY AUTOINCREMENT,  -- never used again: raw of a deleted one cannot come under another
        device INTEGER NOT NULL REFERENCES devices (id),
        since_ns INTEGER NOT NULL,
        person INTEGER REFERENCES persons (id),
        ended_ns INTEGER,
        about TEXT,  -- JSON
        cursor_run INTEGER,
        cursor_boot INTEGER,
        cursor_index INTEGER,
        UNIQUE (device, since_ns)
    ) STRICT
    """,
    "CREATE INDEX sessions_by_person ON sessions (person)",
    """
    CREATE TABLE layouts (
        id INTEGER PRIMARY KEY,
        boot INTEGER NOT NULL,
        rate_hz REAL NOT NULL,
        lsb_per_g REAL NOT NULL,
        lsb_per_rad_s REAL,
        lsb_per_ut REAL
    ) STRICT
    """,
    """
    CREATE UNIQUE INDEX layouts_once
    ON layouts (boot, rate_hz, lsb_per_g, ifnull(lsb_per_rad_s, 0), ifnull(lsb_per_ut, 0))
    """,
    """
    CREATE TABLE raw (
        session INTEGER NOT NULL,
        sensor INTEGER NOT NULL,  -- 0 acceleration, 1 gyroscope, 2 magnetometer
        run INTEGER NOT NULL,
        first INTEGER NOT NULL,
        samples INTEGER NOT NULL,
        layout INTEGER NOT NULL,
        at_ns INTEGER NOT NULL,
        ticks BLOB,  -- with acceleration only
        counts BLOB NOT NULL,
        PRIMARY KEY (session, sensor, run, first)
    ) STRICT, WITHOUT ROWID
    """,
    """
    CREATE TABLE descriptions (
        session INTEGER NOT NULL,
        run INTEGER NOT NULL,
        first INTEGER NOT NULL,
        characteristic TEXT NOT NULL,
        boot INTEGER NOT NULL,
        at_ns INTEGER NOT NULL,
        value BLOB NOT NULL,
        PRIMARY KEY (session, run, first, characteristic)
    ) STRICT, WITHOUT ROWID
    """,
    "CREATE TABLE counters (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE) STRICT",
    """
    CREATE TABLE log (
        device INTEGER NOT NULL,
        ordinal INTEGER NOT NULL,
        session INTEGER NOT NULL,
        at_ns INTEGER NOT NULL,
        uncertainty_s REAL NOT NULL,
        run INTEGER NOT NULL,
        kind TEXT NOT NULL,
        body TEXT,  -- JSON of what is no step
        counter INTEGER,  -- from here on: steps
        boot INTEGER,
        steps INTEGER,
        at_s REAL,
        strength REAL,
        interval_s REAL,
        peak REAL,
        valley REAL,
        upper REAL,
        lower REAL,
        step_uncertainty_s REAL,
        heading_deg REAL,
        heading_uncertainty_deg REAL,
        heading_is_line INTEGER,
        PRIMARY KEY (device, ordinal)
    ) STRICT, WITHOUT ROWID
    """,
    "CREATE UNIQUE INDEX steps_once ON log (session, counter, run, at_s) WHERE counter IS NOT NULL",
    "CREATE INDEX log_by_time ON log (device, at_ns)",
    """
    CREATE TABLE tallies (  -- steps of each counter, which outlive the log
        session INTEGER NOT NULL,
        counter INTEGER NOT NULL,
        steps INTEGER NOT NULL,
        PRIMARY KEY (session, counter)
    ) STRICT, WITHOUT ROWID
    """,
    """
    CREATE TABLE snapshots (
        session INTEGER PRIMARY KEY,
        run INTEGER NOT NULL,
        boot INTEGER NOT NULL,
        first INTEGER NOT NULL,
        at_ns INTEGER NOT NULL,
        state BLOB NOT NULL  -- JSON, zlib
    ) STRICT
    """,
)

MIGRATIONS: Final[tuple[tuple[str, ...], ...]] = (_VERSION_1,)
