"""A process with an air and a crowd of bracelets, all walking.

Argument 1 is how many there are, the others are their sensors. It says its address first. At "away" on its input the
first one leaves, measures for ten minutes and comes back; then it says "back".
"""

import asyncio
import contextlib
import sys

from device_sim.air import LocalAir
from device_sim.air_tcp import AirServer
from device_sim.bracelet import Bracelet
from device_sim.gait import Walker
from service.samples import Sensor

AWAY_S = 590
"""A little less than the bracelet keeps: what goes on meanwhile must not overwrite the first of it."""
SCRIPT = ",".join(["normal:60,rest:5,run:20,slow:30"] * 20)


def say(word):
    sys.stdout.write(f"{word}\n")
    sys.stdout.flush()


async def main(bracelets, sensors):
    async with contextlib.AsyncExitStack() as stack:
        air = await stack.enter_async_context(LocalAir())
        server = await stack.enter_async_context(AirServer(air))
        worn = [Bracelet(Walker(SCRIPT, seed=n, sensors=sensors), device_id=f"sim-{n}") for n in range(bracelets)]
        first, *_ = [await stack.enter_async_context(air.bracelet(one)) for one in worn]
        say(server.address)
        while (await asyncio.to_thread(sys.stdin.readline)).strip() == "away":
            await first.go_away()
            for _ in range(AWAY_S):
                worn[0].measure(50)
                worn[0].discard()
                await asyncio.sleep(0)
            await first.come_back()
            say("back")


if __name__ == "__main__":
    asyncio.run(main(int(sys.argv[1]), tuple(map(Sensor, sys.argv[2:]))))
