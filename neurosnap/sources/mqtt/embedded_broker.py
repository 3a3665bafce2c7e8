"""A small MQTT broker in this process, for trials.

It listens on this machine only, lets everybody in and keeps nothing: who needs more has
a real broker. It runs in a thread with a loop of its own and ends with the `with`.
"""

import asyncio
import socket
import threading
from functools import partial
from types import TracebackType
from typing import Self

from amqtt.adapters import (  # type: ignore[import-untyped]
    StreamReaderAdapter,
    StreamWriterAdapter,
)
from amqtt.broker import Broker  # type: ignore[import-untyped]
from amqtt.contexts import (  # type: ignore[import-untyped]
    BrokerConfig,
    ListenerConfig,
    ListenerType,
)

from neurosnap.errors import InvalidValueError
from neurosnap.sources.mqtt.loop_thread import LoopThread

HOST = "127.0.0.1"
"""Where it listens."""

_LISTENER = "default"
_ANYBODY = "amqtt.plugins.authentication.AnonymousAuthPlugin"


class EmbeddedBroker:
    """A broker on loopback while it is entered.

    Args:
        port: Where it listens; 0: at a free one, which `port` says once it is entered.
    """

    def __init__(self, port: int = 0) -> None:
        self.port = port
        self._ready = threading.Event()
        self._error: Exception | None = None
        self._thread: LoopThread | None = None

    def __enter__(self) -> Self:
        """Listen.

        Raises:
            InvalidValueError: The port is in use, or none.
        """
        serve = partial(self._serve, self._bound())
        self._thread = LoopThread("broker", serve, self._fail)
        self._thread.start()
        self._ready.wait()
        self._raise()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close every connection, and forget everything.

        Raises:
            Exception: What it failed of meanwhile, unless something else is raised.
        """
        if self._thread is not None:
            self._thread.stop()
        if error is None:
            self._raise()

    def _fail(self, error: Exception) -> None:
        self._error = error
        self._ready.set()

    def _raise(self) -> None:
        if self._error is not None:
            raise self._error

    def _bound(self) -> socket.socket:
        """Return a socket of our own: the library would not say which port it got."""
        bound = socket.socket()
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            bound.bind((HOST, self.port))
        except (OSError, OverflowError) as error:
            bound.close()
            rule = f"must be a free port ({error})"
            raise InvalidValueError("port", rule, self.port) from error
        self.port = bound.getsockname()[1]
        return bound

    async def _serve(self, bound: socket.socket, stop: asyncio.Event) -> None:
        with bound as listening:
            broker = Broker(
                BrokerConfig(
                    listeners={_LISTENER: ListenerConfig(type=ListenerType.EXTERNAL)},
                    plugins={_ANYBODY: {"allow_anonymous": True}},
                )
            )
            await broker.start()
            server = await asyncio.start_server(
                partial(_serve_one, broker), sock=listening
            )
            self._ready.set()
            await stop.wait()
            server.close()
            await broker.shutdown()


async def _serve_one(
    broker: Broker, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
) -> None:
    await broker.external_connected(
        StreamReaderAdapter(reader), StreamWriterAdapter(writer), _LISTENER
    )
