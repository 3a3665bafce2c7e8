"""A first stretch learns the range of each signal, and nothing else."""

import msgspec
import pytest

from neurosnap.agent.body import Body
from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.sources.conditions import parse_condition
from neurosnap.sources.live.first_stretch import Ranges, listen
from neurosnap.sources.live.live_source import Feeder, LiveSource
from neurosnap.sources.mqtt import mqtt_source
from neurosnap.sources.mqtt.options import MqttBroker, MqttOptions, MqttSensor
from neurosnap.sources.open import as_in_run, needs_listening, open_source, settle
from neurosnap.sources.protocol import Argument
from neurosnap.sources.ros2.options import Ros2Options
from neurosnap.sources.wanted import Wanted


class Says:
    """A feeder that says something, and has no more to say.

    Args:
        values: What signals say.
        error: What it fails of then.
    """

    def __init__(self, *values: dict[str, object], error: str = "") -> None:
        self._values, self._error = values, error
        self.stopped = 0

    def start(self, source: LiveSource) -> None:
        for values in self._values:
            source.receive(source.readers.read(values)[0])
        if self._error:
            source.fail(NeurosnapError(self._error))
        source.end()

    def stop(self) -> None:
        self.stopped += 1


def test_what_is_heard_decides_how_signals_are_read(
    caplog: pytest.LogCaptureFixture,
) -> None:
    wanted = Wanted(
        ("level", "mode", "door", "note"), (parse_condition("far > 9"),), bins=2
    )
    ranges = Ranges(wanted)
    feeder = Says(
        *({"level": n, "mode": "ab"[n % 2], "door": n > 5} for n in range(10)),
        *({"note": f"it is {n}", "other": 7} for n in range(20)),
    )
    listen(feeder, ranges, 3600)
    assert feeder.stopped == 1
    assert caplog.messages == ["learning the range: 0 of 60 minutes"]
    chosen = ranges.chosen()
    assert {name: [each and each.text for each in chosen[name]] for name in chosen} == {
        "level": ["> 5.0"],
        "mode": ["= a", "= b"],
        "door": [None],
        "far": ["> 9.0"],
    }


def test_what_the_source_fails_of_is_raised_and_silence_is_said() -> None:
    ranges = Ranges(Wanted())
    with pytest.raises(NeurosnapError, match=r"^gone$"):
        listen(Says({"a": 1}, error="gone"), ranges, 3600)
    with pytest.raises(InvalidValueError, match=r"^source: must say something on and"):
        Ranges(Wanted()).chosen()


def test_numbers_of_a_broker_become_sensors_of_its_file(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fake(feeder: Feeder, ranges: Ranges, seconds: float) -> None:
        assert seconds == 60
        assert isinstance(feeder, mqtt_source.MqttFeeder)
        feeder._source = mqtt_source.mqtt_source(MqttOptions(sensors=(door,)))
        feeder._source.readers = ranges
        for n in range(8):
            feeder._receive("house/climate", b'{"t": %d}' % (18 + n), False)
        feeder._source.close()

    monkeypatch.setattr(mqtt_source, "listen", fake)
    door = MqttSensor(name="door", topic="house/door")
    warm = MqttSensor(name="warm", topic="house/climate", field="t", bins=3)
    given = MqttOptions(sensors=(warm, door), stretch=60)
    arguments = {"options": msgspec.json.encode(given).decode()}
    assert needs_listening("mqtt:", arguments)
    settled = settle("mqtt:", arguments)
    assert not needs_listening("mqtt:", settled)
    sensors = open_source("mqtt:", 0, settled).sensors
    assert sensors == ("warm>20", "warm>23", "door")
    options = RunOptions(
        source="mqtt:", arguments=settled, body=Body(own=sensors), ticks=1
    )
    assert {*options.known_order} == {(2, 0), (1, 3)}
    silent = MqttOptions(sensors=(msgspec.structs.replace(warm, topic="house/x"),))
    with pytest.raises(InvalidValueError, match=r"^warm: bins: must say numbers, not"):
        mqtt_source.cut(msgspec.structs.replace(silent, stretch=60))


@pytest.mark.parametrize(
    ("sensor", "rule"),
    [
        ("level > 20, off < 30", "must let the sensor be off below where it is on"),
        ("level > 20 m, off < 10 ft", "must have one unit"),
        ("level heard within 5 years", "must be a time such as 0.5, 500ms"),
    ],
)
def test_a_condition_that_breaks_a_rule_is_no_name(sensor: str, rule: str) -> None:
    with pytest.raises(InvalidValueError, match=rf"^when: {rule}"):
        open_source("-", 0, {"sensors": f'["door", "{sensor}"]'})


def test_the_cuts_of_a_robot_know_their_order() -> None:
    named = ("/b.data", "/b.level > 4", "/b.level > 2", "/b.level rises")
    options = msgspec.json.encode(Ros2Options(sensors=named)).decode()
    own = ("/b.data", "/b.level>4", "/b.level>2", "/b.level rises")
    run = RunOptions(
        source="ros2:", arguments={"options": options}, body=Body(own=own), ticks=1
    )
    assert {*run.known_order} == {(2, 4), (5, 3)}


def test_a_run_that_is_resumed_keeps_its_cuts() -> None:
    def told(options: MqttOptions | Ros2Options) -> dict[str, Argument]:
        return {"options": msgspec.json.encode(options).decode()}

    warm = MqttSensor(name="warm", topic="t", field="x", bins=3)
    door = MqttSensor(name="door", topic="d")
    cuts = [
        msgspec.structs.replace(warm, name=f"warm>{n}", when=f"> {n}", bins=None)
        for n in (20, 23)
    ]
    secret = MqttBroker(username="me", password_env="SECRET")
    house = MqttOptions(sensors=(warm, door), broker=secret)
    ran = told(MqttOptions(sensors=(*cuts, door)))
    again = as_in_run("mqtt:", told(house), ran)
    assert again == told(MqttOptions(sensors=(*cuts, door), broker=secret))
    named = ("/b.data", "/a", "/a.level > 9", "/m.mode", "/a heard within 1 s")
    settled = (
        *("/b.data", "/a.level > 2", "/a.on", "/a.level > 9"),
        *("/m.mode = x", "/m.mode = y", "/a heard within 1 s"),
    )
    again = as_in_run(
        "ros2:", told(Ros2Options(sensors=named)), told(Ros2Options(sensors=settled))
    )
    assert again == told(Ros2Options(sensors=settled, bins=0))
    assert as_in_run("-", {}, {"signals": "{}"}) == {"signals": "{}"}
