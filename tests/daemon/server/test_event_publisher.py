"""The thread that publishes events goes on after one that could not be sent."""

import zmq

from pzctl.daemon.server.publishing.event_publisher import EventPublisher


class _OutOfMemoryOnce(zmq.Socket[bytes]):
    """A PUB socket for whose first message there is no memory."""

    failed = False

    def send_multipart(self, *args: object, **kwargs: object) -> object:
        if not _OutOfMemoryOnce.failed:
            _OutOfMemoryOnce.failed = True
            raise MemoryError
        return super().send_multipart(*args, **kwargs)  # type: ignore[arg-type]


def test_an_event_for_which_there_is_no_memory_is_not_the_last_one() -> None:
    with zmq.Context() as context, _OutOfMemoryOnce(context, zmq.PUB) as events, context.socket(zmq.SUB) as heard:
        heard.subscribe(b"")
        events.set(zmq.XPUB_WELCOME_MSG, b"welcome.")
        heard.connect(f"tcp://127.0.0.1:{events.bind_to_random_port('tcp://127.0.0.1')}")
        publisher = EventPublisher(context, events)
        assert heard.recv() == b"welcome."
        for event in (b"lost", b"next"):
            publisher.say([event])
        assert heard.poll(30_000), "nothing is published any more"
        assert heard.recv() == b"next"
        publisher.close(lambda: None)
