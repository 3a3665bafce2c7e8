"""Readings that any program puts to a swarm's Zenoh keys.

Below ``neurosnap/<swarm>/``, the id that the run began with, without any attachment:

- ``reading/<sensor>``: what one sensor reads: ``true``, ``false``, ``on``, ``off``,
  ``1``, ``0`` or ``null`` (it does not know), in capitals or not; or
  ``{"on": true, "at": 1690000000.0}``.
- ``reading``: one object as in `neurosnap.sources.live.json_reading`: a whole reading,
  which gets a tick of its own; or a single one, for sensors whose names cannot stand in
  a key (Zenoh keeps ``*``, ``$``, ``?`` and ``#`` to itself).

While the swarm is busy up to `WAITING` whole readings wait; then what comes is dropped
and counted. Nothing here can hold a program back: a callback that blocks would stop
every message of the process. Who needs a tick for each reading without exception waits
for the ``state`` of one before putting the next. What is put before the run listens is
lost; a declared publisher's matching status says when it does. From then on it listens
whatever becomes of its swarm, since the hub is in the intake, or is another's. While
that is away nothing is heard: an outage, as of any source.

What goes back is what parts send each other anyway, as JSON: ``state`` (the state the
swarm believes in, ``literals`` packed and in base64), ``decision`` (the action) and
``observation`` (which readings made the tick). Under TLS a program that publishes shows
the certificate of the role ``sensor``, and can do nothing else; one that listens shows
that of a ``watcher``.
"""

import threading
from contextlib import suppress
from typing import Protocol

import zenoh

from neurosnap import wire
from neurosnap.errors import FabricError, InvalidValueError, NeurosnapError, within
from neurosnap.fabric.hub_address import HubAddress
from neurosnap.fabric.roles import READING
from neurosnap.fabric.zenoh.connect_session import (
    connecting,
    reason_of,
    when_lost,
)
from neurosnap.fabric.zenoh.discovery import id_of
from neurosnap.sources.live.json_reading import (
    LIMIT,
    hand_in,
    read_on,
    readings_in,
    too_long,
)
from neurosnap.sources.live.live_source import LiveSource, unknown

_PATIENCE = 10.0  # seconds the hub may take to answer
_TRY = 2.0  # the same once it was there, until it is tried again


class Hub(Protocol):
    """The id of a swarm and the address of its hub, as in a `PartConnection`."""

    @property
    def swarm(self) -> str:
        """The run's id."""

    @property
    def address(self) -> HubAddress:
        """Where the hub listens, and what the part shows to it."""


class ZenohFeeder:
    """Listens to ``reading`` and all below it, over a session of its own.

    Args:
        hub: Whom to connect to, as the world; None for a source that is only looked at.
    """

    def __init__(self, hub: Hub | None) -> None:
        self._hub = hub
        self._thread: threading.Thread | None = None
        self._woken, self._over, self._gone = threading.Event(), False, False

    def start(self, source: LiveSource) -> None:
        """Connect on a thread of its own; what fails of it, the source is told."""
        if self._hub is None:
            rule = "must be a swarm's with a hub, cells in processes"
            source.fail(NeurosnapError(f"source: {rule}, got 'zenoh:'"))
            return
        source.listens(False)
        self._thread = threading.Thread(
            target=self._run,
            args=(source, self._hub),
            name="outside/zenoh",
            daemon=True,
        )
        self._thread.start()

    def stop(self) -> None:
        """Stop listening and close the session; may wait for a hub that is away."""
        self._over = True
        self._woken.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self, source: LiveSource, hub: Hub) -> None:
        try:
            session: zenoh.Session | None
            session = zenoh.open(connecting(hub.address, _PATIENCE))
            while session is not None:
                with session:
                    self._listen(session, source, hub)
                session = self._again(hub)
        except zenoh.ZError as error:
            rule = f"must reach the hub at {hub.address.endpoint}"
            got = reason_of(error)
            source.fail(FabricError(f"readings: {rule}, got {got}"))
        except BaseException as error:  # noqa: BLE001 - goes on to `step`, whole
            source.fail(error)

    def _again(self, hub: Hub) -> zenoh.Session | None:
        """Return a new session once the hub is back; None if it was stopped before."""
        while not self._over:
            with suppress(zenoh.ZError):
                return zenoh.open(connecting(hub.address, _TRY))
        return None

    def _listen(self, session: zenoh.Session, source: LiveSource, hub: Hub) -> None:
        """Listen until the hub goes, or until it is stopped."""

        def on_sample(sample: zenoh.Sample) -> None:
            if sample.kind == zenoh.SampleKind.PUT:
                *_, key = str(sample.key_expr).split("/", 2)
                hand_over(source, key, sample.payload)

        def lose() -> None:
            self._gone = True
            source.listens(False)
            self._woken.set()

        self._gone = False
        self._woken.clear()
        # A swarm that goes on after a death is called otherwise, and no program outside
        # knows of that.
        for name in dict.fromkeys((hub.swarm, id_of(hub.swarm))):
            session.declare_subscriber(
                f"{wire.ROOT}/{name}/{READING}/**",
                zenoh.handlers.Callback(on_sample, indirect=False),
            )
        end = when_lost(session, lose)
        source.listens(True)
        if self._gone:  # meanwhile: that is an outage by now
            source.listens(False)
        while not (self._over or self._gone):
            self._woken.wait()
            self._woken.clear()
        end()


def hand_over(source: LiveSource, key: str, payload: zenoh.ZBytes) -> None:
    """Hand in one message; what is no reading is refused.

    The key is below the swarm's prefix; a large payload is not even copied.
    """
    try:
        if len(payload) > LIMIT:
            raise too_long()
        text = payload.to_bytes()
        _, named, sensor = key.partition("/")
        if not named:
            hand_in(source, text, spare=False)
        else:
            said, at = read_on(text)
            strange = () if source.readers.wants(sensor) else (unknown(sensor),)
            source.receive(readings_in(source, {sensor: said}), at, strange)
    except InvalidValueError as error:
        source.refuse(str(within(key, error)))
