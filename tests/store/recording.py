"""A process that records until it is killed: argument 1 is the database, 2 the seconds to record of each device.

It goes on where the database ends, and says "DEVICE SECOND" on its output once that second is on the disk.
"""

import asyncio
import sys
from pathlib import Path

from store import made

from service.store.store import open_store
from service.store.values import Batch

DEVICES = ("sim-0", "sim-1", "sim-2")
SNAPSHOT_EVERY = 7


async def record(store, key, seconds):
    known = {one.key: one for one in await store.read(lambda reader: reader.resume())}
    begun = known[key].cursor.index // made.RATE_HZ if key in known else 0
    for k in range(begun, seconds):
        await store.append(made.second(key, k, seed=DEVICES.index(key.device)))
        sys.stdout.write(f"{key.device} {k}\n")
        sys.stdout.flush()
        if k % SNAPSHOT_EVERY == 0:
            await store.append(Batch(session=key, snapshot=made.snapshot(made.RATE_HZ * (k + 1))))


async def main(path, seconds):
    async with open_store(path, queue_batches=100) as store, asyncio.TaskGroup() as tasks:
        for device in DEVICES:
            tasks.create_task(record(store, made.session(device), seconds))


if __name__ == "__main__":
    asyncio.run(main(Path(sys.argv[1]), int(sys.argv[2])))
