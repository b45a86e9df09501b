"""An answer that is sent later, when another thread has made it, leaves no other request unanswered."""

import asyncio
import json
import time
from collections import Counter
from types import SimpleNamespace

import zmq
import zmq.asyncio

from pzctl.daemon.server.requests.request_server import RequestServer
from pzctl.daemon.wire.replies import Answer


def test_a_request_that_comes_just_before_a_later_answer_is_sent() -> None:
    """Sending takes libzmq's notice that something has come: whoever waits for that must look again."""
    metrics = SimpleNamespace(counts=Counter[str](), lasted=lambda _what, _seconds: None)
    handlers = SimpleNamespace(metrics=metrics, answer=lambda request, _raw, _client: (Answer(id=request.id), []))
    access = SimpleNamespace(check=lambda _key, _request: "ana")

    async def told() -> str:
        with zmq.asyncio.Context() as context, context.socket(zmq.ROUTER) as router, zmq.Context() as theirs:
            port = router.bind_to_random_port("tcp://127.0.0.1")
            with theirs.socket(zmq.DEALER) as client:
                client.linger, client.rcvtimeo = 0, 0
                client.connect(f"tcp://127.0.0.1:{port}")
                server = RequestServer(router, handlers, access, SimpleNamespace(heard=lambda _handle: None))  # type: ignore[arg-type]
                serving = asyncio.create_task(server.serve())
                await asyncio.sleep(0.2)
                client.send(b'{"request": "status", "id": "s"}')
                time.sleep(0.2)  # it comes while this loop does something else
                server._send([b"another client"], [b"{}"], time.monotonic(), -1)
                for _ in range(100):
                    await asyncio.sleep(0.02)
                    try:
                        return json.loads(client.recv())["id"]
                    except zmq.Again:
                        continue
                    finally:
                        if serving.done():
                            serving.result()
                return "nothing"

    assert asyncio.run(told()) == "s"
