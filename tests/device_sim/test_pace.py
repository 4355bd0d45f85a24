"""Running Speed and Cadence beside the raw stream, as the walker goes."""

import pytest

from device_sim.air import LocalAir
from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from device_sim.pace import Pace
from service.wearables import rsc


def test_cadence_is_that_of_the_last_seconds_and_begins_anew_with_the_register():
    pace = Pace()
    assert pace.measurement().cadence_spm == 0
    for second in range(20):
        pace.take(float(second), 2 * second)
    assert (pace.measurement().cadence_spm, pace.measurement().running) == (120, False)
    for second in range(20, 40):
        pace.take(float(second), 40 + 3 * (second - 20))
    assert (pace.measurement().cadence_spm, pace.measurement().running) == (180, True)
    assert pace.measurement().speed_m_s == pytest.approx(3.0)
    pace.take(0.0, 0)
    assert pace.measurement().cadence_spm == 0


@pytest.mark.parametrize(("walk", "running"), [("normal:60@110", False), ("run:60@170", True)])
@pytest.mark.full
async def test_a_host_hears_the_walkers_cadence(radio, walk, running):
    bracelet = Bracelet(Walker(walk, seed=1, loop=True))
    async with LocalAir() as air, air.bracelet(bracelet, speed=40), air.central() as central:
        host = await radio.Host.connect(central)
        assert rsc.decode_feature(bytes(await host.client.read_gatt_char(rsc.FEATURE))) == rsc.RUNNING
        told = []
        await host.client.start_notify(rsc.MEASUREMENT, lambda _, data: told.append(rsc.decode(bytes(data))))
        await radio.until(lambda: len(told) > 12)
        assert told[-1].cadence_spm == pytest.approx(170 if running else 110, abs=15)
        assert told[-1].running == running
