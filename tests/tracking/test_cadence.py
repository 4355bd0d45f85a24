"""Cadence: the last steps of the bout at hand, nothing else."""

import pytest

from service.tracking.cadence import Cadence


def fed(*times):
    cadence = Cadence()
    for at_s in times:
        cadence.add(at_s)
    return cadence


def test_steps_a_minute():
    assert fed(*(i * 0.5 for i in range(20))).spm(10.0) == pytest.approx(120)


def test_a_change_of_pace_shows_within_five_steps():
    times = [0.5 * i for i in range(10)]
    times += [times[-1] + 0.4 * i for i in range(1, 6)]
    assert fed(*times).spm(times[-1]) == pytest.approx(150)


def test_one_step_is_no_cadence_and_a_pause_begins_anew():
    assert fed(1.0).spm(1.0) is None
    assert fed(1.0, 1.5, 9.0).spm(9.0) is None
    assert fed(1.0, 1.5, 9.0, 9.6).spm(9.6) == pytest.approx(100)


def test_it_expires():
    cadence = fed(1.0, 1.5)
    assert cadence.spm(5.4) is not None
    assert cadence.spm(5.6) is None


def test_snapshot():
    cadence = Cadence()
    cadence.restore(fed(1.0, 1.5).snapshot())
    cadence.add(2.0)
    assert cadence.spm(2.0) == fed(1.0, 1.5, 2.0).spm(2.0)
