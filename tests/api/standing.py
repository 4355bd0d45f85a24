"""The API over devices on stands: the real application and pipeline, without radio, sockets or waiting."""

import contextlib

import httpx
from pipeline.stand import Stand

from service.api.app import create_app
from service.pipeline.hub import Hub
from service.pipeline.lineup import lineup
from service.pipeline.supervisor import Supervisor
from service.pipeline.trials import Trials
from service.wearables.bracelet import Bracelet


class Standing:
    """The stands, and the application's client."""

    def __init__(self, stands, http):
        self.stands = stands
        self.http = http

    def walk(self, seconds, **how):
        for stand in self.stands:
            stand.walk(seconds, **how)

    async def ask(self, method, path, status=200, **body):
        """Return the answer's JSON (or text), whose status must be `status`."""
        answer = await self.http.request(method, f"/api/v1/{path}", **({"json": body["json"]} if body else {}))
        assert answer.status_code == status, answer.text
        is_json = answer.content and answer.headers["content-type"] == "application/json"
        return answer.json() if is_json else answer.text

    async def refused(self, method, path, status, **body):
        """Return the sentence of a refusal."""
        detail = (await self.ask(method, path, status, **body))["detail"]
        assert isinstance(detail, str)
        return detail


@contextlib.asynccontextmanager
async def standing(*schedules, **options):
    """The API over one device for each schedule: sim-1, sim-2 and so on."""
    stands = [Stand(schedule, device_id=f"sim-{n}", seed=n, **options) for n, schedule in enumerate(schedules, 1)]
    supervisor = Supervisor(hub=Hub(durable_limit=1000), make_wearable=Bracelet, lineup=lineup("double_threshold"))
    for stand in stands:
        supervisor.remember(stand.device)
    app = create_app(supervisor, Trials(lambda: stands[0].now_ns, lambda: stands[0].now_ns))
    transport = httpx.ASGITransport(app=app)
    async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1") as http:
        yield Standing(stands, http)
