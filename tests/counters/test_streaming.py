"""What the kernel counters share: rows of a recording, and columns that are no lists."""

import numpy as np

from service.counters import registry, streaming
from service.samples import SampleBlock


def test_more_rows_than_expected_find_room():
    rows = streaming._Rows(samples=24, row=2)
    parts = [np.arange(4.0) + 4 * k for k in range(30)]
    for part in parts:
        rows.add(part)
    assert np.array_equal(rows.all(), np.concatenate(parts))


def test_columns_need_not_be_lists():
    column = tuple(1.0 + 0.5 * np.sin(np.arange(500) / 4.0))
    mixed = SampleBlock(start=0, acc_g=([0.0] * 500, [0.0] * 500, column))
    lists = SampleBlock(start=0, acc_g=([0.0] * 500, [0.0] * 500, [float(value) for value in column]))
    for name in ("double_threshold", "plus_minus"):
        one, other = registry.make(name), registry.make(name)
        assert one.update(mixed) == other.update(lists)
        assert one.snapshot() == other.snapshot()
        assert all(type(value) is float for value in one.snapshot()["state"])
