import asyncio

import pytest

from device_sim.operations import Operations


async def answer_after(event, value=1):
    await event.wait()
    return value


async def swallow(cancellations):
    """Go on after a cancellation, as `wait_for` makes of one that comes with an answer before Python 3.12."""
    while cancellations:
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            cancellations -= 1
    return "ended"


async def test_an_operation_outlives_its_cancelled_caller():
    operations, answered = Operations("test"), asyncio.Event()
    caller = asyncio.create_task(operations.run(answer_after(answered), 5))
    await asyncio.sleep(0)
    caller.cancel()
    await asyncio.wait({caller})
    assert caller.cancelled()
    assert len(operations) == 1
    answered.set()
    await operations.settle()
    assert len(operations) == 0


async def test_an_operation_without_an_answer_times_out_and_stays_owned():
    operations = Operations("test")
    with pytest.raises(TimeoutError, match="test"):
        await operations.run(answer_after(asyncio.Event()), 0.01)
    assert len(operations) == 1
    await operations.close()
    assert len(operations) == 0


async def test_close_ends_what_swallows_cancellations():
    operations = Operations("test")
    task = operations.spawn(swallow(3))
    await asyncio.sleep(0)
    await asyncio.wait_for(operations.close(), 1)
    assert task.result() == "ended"


async def test_an_error_nobody_waits_for_is_not_reported_as_forgotten():
    async def fail():
        raise RuntimeError("the link dropped")

    heard = []
    asyncio.get_running_loop().set_exception_handler(lambda _loop, context: heard.append(context))
    operations = Operations("test")
    operations.spawn(fail())
    await operations.settle()
    assert heard == []
    task = await operations.run(fail(), 1)
    with pytest.raises(RuntimeError):
        task.result()
