"""The file: made, refused, migrated, and never left half way."""

import contextlib
import dataclasses
import sqlite3

import numpy as np
import pytest
from store import made

from service.errors import StoreError, StoreFault
from service.store import database
from service.store.schema import APPLICATION_ID, MIGRATIONS
from service.store.store import open_store
from service.store.values import Batch

LATER = (*MIGRATIONS, ("ALTER TABLE devices ADD COLUMN colour TEXT", "UPDATE devices SET colour = 'grey'"))


def pragma(path, name):
    with contextlib.closing(sqlite3.connect(path)) as connection:
        return connection.execute(f"PRAGMA {name}").fetchone()[0]


def tables(path):
    with contextlib.closing(sqlite3.connect(path)) as connection:
        return dict(connection.execute("SELECT name, sql FROM sqlite_schema WHERE sql IS NOT NULL"))


@pytest.fixture
async def filled(tmp_path):
    path = tmp_path / "steplink.db"
    async with open_store(path, queue_batches=10) as store:
        for k in range(2):
            await store.append(made.second(made.session(), k))
    return path


def test_a_new_file_in_a_new_folder_is_its_owners(tmp_path):
    path = tmp_path / "deep" / "folder" / "steplink.db"
    database.prepare(path)
    database.prepare(path)
    assert path.stat().st_mode & 0o777 == 0o600
    assert (pragma(path, "journal_mode"), pragma(path, "auto_vacuum")) == ("wal", 2)
    assert (pragma(path, "application_id"), pragma(path, "user_version")) == (APPLICATION_ID, len(MIGRATIONS))


def test_every_version_leads_to_the_same_tables(tmp_path):
    """Each released version, made by its own steps, and brought to the newest."""
    database.prepare(tmp_path / "new.db")
    for version in range(1, len(MIGRATIONS) + 1):
        path = tmp_path / f"{version}.db"
        database.prepare(path, MIGRATIONS[:version])
        assert pragma(path, "user_version") == version
        database.prepare(path)
        assert tables(path) == tables(tmp_path / "new.db")


async def test_a_migration_keeps_what_was_stored(filled):
    database.prepare(filled, LATER)
    with contextlib.closing(sqlite3.connect(filled)) as connection:
        assert connection.execute("SELECT name, colour FROM devices").fetchall() == [("sim-1", "grey")]
        assert connection.execute("SELECT count(*) FROM log").fetchone() == (4,)
    assert pragma(filled, "user_version") == len(LATER)


async def test_a_migration_that_fails_leaves_the_version_before(filled):
    before = tables(filled)
    with pytest.raises(StoreError):
        database.prepare(
            filled, (*MIGRATIONS, ("ALTER TABLE devices ADD COLUMN colour TEXT", "UPDATE nothing SET x = 1"))
        )
    assert (tables(filled), pragma(filled, "user_version")) == (before, len(MIGRATIONS))
    database.prepare(filled)


async def refused(path):
    with pytest.raises(StoreError) as error:
        async with open_store(path, queue_batches=10):
            pass
    assert str(path) in error.value.why
    return error.value


async def test_a_newer_file_is_refused(filled):
    database.prepare(filled, LATER)
    error = await refused(filled)
    assert error.reason is StoreFault.NEWER
    assert "a later" in error.why


def test_an_old_sqlite_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(sqlite3, "sqlite_version_info", (3, 34, 1))
    with pytest.raises(StoreError, match=r"3\.37 or later"):
        database.prepare(tmp_path / "s.db")
    assert list(tmp_path.iterdir()) == []


async def test_a_value_of_the_wrong_type_is_refused(tmp_path):
    wrong = dataclasses.replace(made.step(1), run=np.int64(0))
    async with open_store(tmp_path / "s.db", queue_batches=10) as store:
        with pytest.raises(StoreError) as error:
            await store.append(Batch(session=made.session(), entries=(wrong,)))
        assert error.value.reason is StoreFault.REFUSED


async def test_other_files_are_refused_and_left_alone(tmp_path):
    text, other = tmp_path / "letter.txt", tmp_path / "other.db"
    text.write_text("Dear all,\n" * 500)
    with contextlib.closing(sqlite3.connect(other)) as connection:
        connection.execute("CREATE TABLE notes (text)")
    assert (await refused(text)).reason is StoreFault.FOREIGN
    assert text.read_text() == "Dear all,\n" * 500
    assert (await refused(other)).reason is StoreFault.FOREIGN
    assert list(tables(other)) == ["notes"]


async def test_a_damaged_file_is_refused_with_what_to_do(filled):
    pages = pragma(filled, "page_count")
    data = bytearray(filled.read_bytes())
    data[4096 * (pages // 2) : 4096 * pages] = b"\xa5" * (4096 * (pages - pages // 2))
    filled.write_bytes(data)
    error = await refused(filled)
    assert error.reason is StoreFault.CORRUPT
    assert "backup" in error.why
    assert not error.is_passing


async def test_a_folder_in_its_place_is_told(tmp_path):
    assert (await refused(tmp_path)).reason in {StoreFault.IO, StoreFault.READ_ONLY}


async def test_a_check_finds_what_contradicts_itself(filled):
    async with open_store(filled, queue_batches=10) as store:
        await store.read(lambda reader: reader.check())
        assert (await store.read(lambda reader: reader.statistics()))["log"] == 4
    with contextlib.closing(sqlite3.connect(filled, isolation_level=None)) as connection:
        connection.execute("PRAGMA writable_schema = ON")
        connection.execute(
            "UPDATE sqlite_schema SET rootpage = (SELECT rootpage FROM sqlite_schema WHERE name = 'log_by_time') "
            "WHERE name = 'steps_once'"
        )
    with contextlib.closing(database.connect_reader(filled)) as connection, pytest.raises(StoreError) as error:
        database.check(connection, filled)
    assert error.value.reason is StoreFault.CORRUPT


async def test_a_store_that_was_closed_is_one_file(tmp_path):
    path = tmp_path / "s.db"
    async with open_store(path, queue_batches=10) as store:
        await store.append(made.second(made.session("dev-1"), 0))
        await store.read(lambda reader: reader.devices())
        assert path.with_name("s.db-wal").exists()
    assert {file.name for file in tmp_path.iterdir()} <= {"s.db", "s.db.lock"}
