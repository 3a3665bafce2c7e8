"""The publisher's state, tick by tick, without a broker."""

from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("aiomqtt")

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.health.alarm import Alarm, AlarmProgress, Standing
from neurosnap.sensorium import pack
from neurosnap.sources.mqtt.options import MqttBroker, MqttPublish
from neurosnap.sources.mqtt.publisher import MqttPublisher

NAMES = ["door", "hall", "light"]
LITERALS = {b"ON": (1, 0), b"OFF": (0, 1), b"unknown": (0, 0)}
WORDS = [b"ON", b"OFF", b"unknown"]


def state(words: list[bytes], tick: int = 1, edges: int = 0) -> wire.State:
    literals = pack([bit for word in words for bit in LITERALS[word]])
    return wire.State(tick, 1, literals, False, 0, 0, 0, edges, 0)


def publisher(**more: Any) -> MqttPublisher:
    return MqttPublisher(MqttBroker(), MqttPublish(prefix="p"), NAMES, **more)


def held(outlet: MqttPublisher, topic: str) -> object:
    """Return the JSON that a topic says."""
    return msgspec.json.decode(outlet._link._outbox._held[topic])


@given(
    st.lists(
        st.lists(st.sampled_from(sorted(LITERALS)), min_size=3, max_size=3), min_size=1
    )
)
def test_every_topic_says_what_the_last_state_does(ticks: list[list[bytes]]) -> None:
    outlet = publisher()
    for words in ticks:
        outlet.state(state(words))
        topics = outlet._link._outbox._held
        assert [topics[f"p/sensor/{name}"] for name in NAMES] == words


def test_only_what_changed_is_handed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    outlet = publisher()
    outlet.state(state(WORDS))
    handed: list[str] = []
    monkeypatch.setattr(outlet._link, "hold", lambda topic, _: handed.append(topic))
    outlet.state(state([b"ON", b"ON", b"unknown"]))
    assert handed == ["p/sensor/hall"]


def test_a_decision_has_the_name_of_its_action() -> None:
    outlet = publisher(actions=["none", "ring"])
    outlet.decision(wire.Decision(1, -1, "nothing to do"))
    assert "p/decision" not in outlet._link._outbox._held
    outlet.decision(wire.Decision(1, 1, "greedy"))
    assert held(outlet, "p/decision") == {"action": "ring", "why": "greedy"}
    rule = r"^action: must be a whole number in 0\.\.1, got 2$"
    with pytest.raises(InvalidValueError, match=rule):
        outlet.decision(wire.Decision(1, 2, "greedy"))


def test_the_last_anomaly_and_alarm_stay_to_be_looked_at_when_they_are_over() -> None:
    outlet = publisher(judges=True)
    record = {"tick": 3, "culprits": ["door"]}
    assert held(outlet, "p/anomaly") == {"now": "OFF", "last": {}}
    assert held(outlet, "p/health/door") == {"now": "OFF", "last": ""}
    outlet.anomaly(record)
    assert held(outlet, "p/anomaly") == {"now": "ON", "last": record}
    outlet.anomaly(None)
    assert held(outlet, "p/anomaly") == {"now": "OFF", "last": record}

    alarm = Alarm("UTC", "door", "silent", 1.0, 2.0, 0.0, "why", "else")
    calm = Standing(3, AlarmProgress(89, 300, 2, 3))
    outlet.health(msgspec.structs.replace(calm, alarms=(alarm,)))
    assert held(outlet, "p/health/door") == {"now": "ON", "last": alarm.line()}
    assert held(outlet, "p/health") == {
        "changes": 89,
        "of_about": 300,
        "known": 2,
        "of": 3,
    }
    outlet.health(calm)
    assert held(outlet, "p/health/door") == {"now": "OFF", "last": alarm.line()}
