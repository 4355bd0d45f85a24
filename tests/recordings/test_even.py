"""The rate a device would state: the nominal one, or the grid's where the stamps are uneven."""

from pathlib import Path

import numpy as np
import pytest

from service.recordings import Recording
from service.recordings.even import evenly_spaced, stated_rate_hz


def recorded(t_s, rate_hz):
    acc_g = np.tile([0.0, 0.0, 1.0], (len(t_s), 1))
    return Recording(path=Path("walk.csv"), t_s=t_s, acc_g=acc_g, rate_hz=rate_hz)


def test_an_even_recording_keeps_its_rate_in_hundredths():
    assert stated_rate_hz(recorded(np.arange(1000) / 12.5, 12.5)) == 12.5
    assert stated_rate_hz(recorded(np.arange(1000) / 52.0833, 52.0833)) == 52.08


@pytest.mark.parametrize(("moved", "rate_hz"), [(1, 25.0), (20, 50.0)])
def test_a_few_uneven_stamps_do_not_make_a_recording_uneven(moved, rate_hz):
    t_s = np.arange(4000) / 25
    t_s[100 : 100 + 2 * moved : 2] += 0.01
    assert stated_rate_hz(recorded(t_s, 25.0)) == rate_hz


def test_values_lie_where_they_were_measured():
    t_s = np.array([5.0, 5.1, 5.3, 5.4])
    values = np.column_stack([t_s] * 3)
    even = evenly_spaced(recorded(t_s, 10.0), values, 50.0)
    assert even[:, 0] == pytest.approx(5.0 + np.arange(21) / 50)
