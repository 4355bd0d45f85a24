"""A virtual air in a process of its own, which may be killed: `python air_alone.py HOST:PORT`."""

import asyncio
import sys

from device_sim.air_tcp import hosted_air


async def serve(address):
    async with hosted_air(address):
        print("the air is open", flush=True)
        await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(serve(sys.argv[1]))
