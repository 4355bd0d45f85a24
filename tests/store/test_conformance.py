"""The SQLite store keeps every promise of the contract."""

import functools

import pytest
from store import conformance

from service.store.store import open_store


@pytest.mark.parametrize("check", conformance.CHECKS, ids=lambda check: check.__name__)
async def test_sqlite(check, tmp_path):
    await check(functools.partial(open_store, tmp_path / "steplink.db", queue_batches=50))
