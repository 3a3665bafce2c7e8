"""Valid and invalid readings put to a Zenoh key, and their effect."""

from dataclasses import dataclass

import pytest
import zenoh

from neurosnap.errors import InvalidValueError
from neurosnap.fabric.hub_address import HubAddress
from neurosnap.sources.live.json_reading import LIMIT
from neurosnap.sources.live.latest_or_late import LatestReadings
from neurosnap.sources.live.live_source import ROOM, LiveSource
from neurosnap.sources.live.tick_schedule import Clocked
from neurosnap.sources.live.zenoh_source import ZenohFeeder, hand_over
from tests.support.sources import readings

NAMES = ["door", "kitchen/motion"]


@dataclass(frozen=True)
class Hub:
    address: HubAddress
    swarm: str = "one"


def after(*messages: tuple[str, bytes]) -> tuple[list[bool | None], LiveSource]:
    """Return what the next tick shows once all came; None is what is not known."""
    source = LiveSource(LatestReadings(NAMES), Clocked(1.0))
    source.receive({"door": False})
    for key, payload in messages:
        hand_over(source, key, zenoh.ZBytes(payload))
    seen = source.first()
    assert seen is not None
    return readings(seen), source


@pytest.mark.parametrize(
    ("payload", "on"),
    [
        (b"ON", True),
        (b"1\n", True),
        (b'"on"', True),
        (b"Off", False),
        (b"null", None),
        (b' {"on": "OFF", "at": 7}', False),
        (b'{"on": null}', None),
    ],
)
def test_a_value_under_a_sensors_key(payload: bytes, on: bool | None) -> None:
    shown, source = after(("reading/kitchen/motion", payload))
    assert shown == [False, on]
    assert source.statistics().received.refused == 0


def test_objects_under_the_key_of_all() -> None:
    single = b'{"sensor": "door", "on": 1}'
    assert after(("reading", single))[0] == [True, None]
    shown, source = after(
        ("reading", b'{"bits": [0, 1]}'), ("reading", b'{"bits":[1,0]}')
    )
    assert shown == [False, True]
    following = source.step(-1)
    assert following is not None
    assert following.bits.tolist() == [True, False]


@pytest.mark.parametrize(
    ("key", "payload", "text"),
    [
        ("reading/door", b"x" * 1000, "reading/door: door: must be 0 or 1, false"),
        ("reading/door", b'{"att": 2}', "reading/door: reading: must be {'on': value"),
        ("reading", b"on", "reading: reading: must be a reading in JSON"),
        ("reading", b'{"bits": [1]}', "reading: bits: must be 2, one a sensor, got 1"),
        ("reading", bytes(LIMIT + 1), f"reading: reading: must be up to {LIMIT} bytes"),
        (
            "reading/door",
            b'{"on": 1}' + b" " * LIMIT,
            "reading/door: reading: must be u",
        ),
        ("reading/lamp", b"on", "sensor: must be one the run began with, got 'lamp'"),
        ("reading/", b"on", "sensor: must be one the run began with, got ''"),
    ],
)
def test_what_is_no_reading_is_refused_and_changes_nothing(
    key: str, payload: bytes, text: str, caplog: pytest.LogCaptureFixture
) -> None:
    shown, source = after((key, payload))
    assert shown == [False, None]
    assert source.statistics().received.refused == 1
    assert caplog.messages[0].startswith(text)
    assert len(caplog.messages[0]) < 400


def test_nobody_is_held_back_and_what_is_too_much_goes(
    caplog: pytest.LogCaptureFixture,
) -> None:
    whole = ("reading", b'{"bits": [1, 1]}')
    _, source = after(*[whole] * (ROOM + 5))
    assert source.statistics().received.dropped == 5
    assert f"must wait for fewer than {ROOM} others, dropped" in caplog.messages[0]


def test_whatever_keeps_it_from_listening_the_source_fails_of(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def connecting(*_: object) -> None:
        raise InvalidValueError("keys", "must be readable", "ca.pem")

    monkeypatch.setattr("neurosnap.sources.live.zenoh_source.connecting", connecting)
    feeder = ZenohFeeder(Hub(HubAddress("tcp/127.0.0.1:1")))
    source = LiveSource(LatestReadings(NAMES), Clocked(1.0), feeder=feeder)
    with pytest.raises(InvalidValueError, match=r"^keys: must be readable"):
        source.first()
    source.close()
