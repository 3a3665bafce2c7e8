"""MQTT topics as sensors, and published messages as actions.

What a sensor reads is the latest message of its topic. One message may feed several
sensors. Readings carry no time: they count from their arrival, and what the broker had
kept counts from when it was delivered.

With a journal a message is acknowledged once it is in there, and the broker keeps what
comes while this process is away, for the next one with that journal: see `MqttLink`.

When the broker is away, nothing comes and the source goes on: readings go stale by the
same rule as ever, and a sensor with `heard_within` is unknown until it can be heard
again, since silence says nothing then.
"""

import asyncio
import threading
from contextlib import suppress

from msgspec.structs import replace

from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.sources.cuts import Signal
from neurosnap.sources.live.first_stretch import Ranges, listen
from neurosnap.sources.live.journal import Journal
from neurosnap.sources.live.latest_or_late import LatestReadings
from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.meaning import Numbers
from neurosnap.sources.mqtt.connection import MqttLink
from neurosnap.sources.mqtt.options import MqttOptions, MqttSensor
from neurosnap.sources.mqtt.outbox import Outgoing
from neurosnap.sources.mqtt.payload import Payload, PayloadReader
from neurosnap.sources.mqtt.publisher import Topics
from neurosnap.sources.wanted import Wanted


def mqtt_source(
    options: MqttOptions, *, journal: Journal | None = None, most: int | None = None
) -> LiveSource:
    """Return the source that `options` describe; it connects with its first tick.

    At each step exactly one action is taken: its payload is published, if the broker
    can be told within `neurosnap.sources.mqtt.outbox.LASTS` seconds. The first action
    is to do nothing.

    Args:
        options: What is read and done.
        journal: As for `LiveSource`.
        most: As for `LiveSource`.

    Raises:
        InvalidValueError: The certificates to trust cannot be read, or the password.
    """
    feeder = MqttFeeder(options, journal)
    source = LiveSource(
        LatestReadings(
            [sensor.name for sensor in options.sensors],
            stale_after=[
                options.stale_after
                if sensor.stale_after is None
                else sensor.stale_after
                for sensor in options.sensors
            ],
            heard_within=[sensor.heard_within for sensor in options.sensors],
        ),
        options.tick.schedule(),
        feeder=feeder,
        actions=options.action_names,
        actuate=feeder.actuate,
        journal=journal,
        most=most,
    )
    source.numbers = feeder.numbers
    return source


def cut(options: MqttOptions) -> MqttOptions:
    """Return options with a sensor for each cut of the numbers that ask for some.

    Where any does, the broker is listened to first, for as long as `stretch` says.

    Raises:
        NeurosnapError: The broker cannot be reached, or a number said nothing.
    """
    asks = tuple(sensor for sensor in options.sensors if sensor.bins is not None)
    if not asks:
        return options
    ranges = Ranges(Wanted())
    looks = replace(options, sensors=asks, actions=(), publish=None)
    listen(MqttFeeder(looks), ranges, options.stretch)
    found: list[MqttSensor] = []
    for sensor in options.sensors:
        if sensor.bins is None:
            found.append(sensor)
            continue
        signal = ranges.heard.get(sensor.name, Signal())
        cuts = list(signal.cuts(sensor.name, sensor.bins))
        if not cuts:
            rule = f"must say numbers, not always the same, in {options.stretch:g} s"
            raise InvalidValueError(f"{sensor.name}: bins", rule, signal.says())
        found += (
            replace(sensor, name=each.name, when=each.text, bins=None) for each in cuts
        )
    return replace(options, sensors=tuple(found))


class MqttFeeder:
    """Turns MQTT messages into readings, and actions into MQTT messages.

    Args:
        options: What is read and done.
        journal: As for `LiveSource`; it says what the broker knows the client by, and
            whether a process before connected: then this one waits as long as the run.

    Raises:
        InvalidValueError: As `mqtt_source`.
    """

    def __init__(self, options: MqttOptions, journal: Journal | None = None) -> None:
        self._options = options
        self._readers: dict[str, list[tuple[MqttSensor, PayloadReader]]] = {}
        readers = [(sensor, PayloadReader(sensor)) for sensor in options.sensors]
        for sensor, reader in readers:
            self._readers.setdefault(sensor.topic, []).append((sensor, reader))
        self.numbers = Numbers([reader.reader for _, reader in readers])
        self._source: LiveSource | None = None
        publish = options.publish
        self._link = MqttLink(
            options.broker,
            "world",
            status=None if publish is None else Topics(publish.prefix, ()).world,
            filters=[*self._readers],
            receive=self._receive,
            connected=self._connected,
            session="" if journal is None else journal.run,
        )
        if journal is not None and journal.follows:
            self._link.go_on()
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._over = asyncio.Event()

    def start(self, source: LiveSource) -> None:
        """Begin to connect; what the link fails of, see there, the source fails of."""
        self._source = source
        source.listens(False)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(
            target=self._run, args=(self._loop, source), name="mqtt", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Disconnect from the broker; may be called twice.

        Takes no longer than a connection that is being made: a broker that accepts and
        then says nothing holds it up for five seconds, and one whose machine does not
        answer for as long again.
        """
        if self._loop is None or self._thread is None or self._source is None:
            return
        if self._source.over:
            self._link.forget()
        with suppress(RuntimeError):  # the loop is closed: it has ended by itself
            self._loop.call_soon_threadsafe(self._over.set)
        self._thread.join()

    def _run(self, loop: asyncio.AbstractEventLoop, source: LiveSource) -> None:
        try:
            with asyncio.Runner(loop_factory=lambda: loop) as runner:
                runner.run(self._link.serve(self._over))
        except Exception as error:  # noqa: BLE001 - it is passed on, whatever it is
            source.fail(error)

    def actuate(self, choice: int) -> None:
        """Publish what belongs to a choice, counted from 0, which is to do nothing.

        Raises:
            InvalidValueError: There is no such choice.
        """
        actions = self._options.actions
        if not 0 <= choice <= len(actions):
            rule = f"must be a whole number in 0..{len(actions)}"
            raise InvalidValueError("action", rule, choice)
        if choice:
            action = actions[choice - 1]
            self._link.send(
                Outgoing(action.topic, action.payload.encode(), action.retain)
            )

    def _receive(self, topic: str, data: bytes, retained: bool) -> None:
        """Hand in what a message says, sensor by sensor.

        Raises:
            NeurosnapError: It is not safe, so it must not be acknowledged.
        """
        if self._source is None or topic not in self._readers:
            return
        payload = Payload(topic, data)
        readings: dict[str, bool | None] = {}
        wrong: list[str] = []
        for sensor, reader in self._readers[topic]:
            if retained and sensor.heard_within is not None:
                continue  # it may have been kept for days
            try:
                if sensor.bins is None:
                    readings[sensor.name] = reader.read(payload)
                else:  # of which only the range is learned
                    self._source.readers.read({sensor.name: reader.value(payload)})
            except InvalidValueError as error:
                wrong.append(f"{sensor.name}: {error}")
        if not self._source.receive(readings, wrong=wrong):
            raise NeurosnapError("reading: must be in the journal, is not")

    def _connected(self, on: bool) -> None:
        if self._source is not None:
            self._source.listens(on)
