"""Delays grow, part clients, and stay long where haste does not help."""

import random
import ssl

import aiomqtt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.reasoncodes import ReasonCode

from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.sources.mqtt.options import MqttBroker
from neurosnap.sources.mqtt.retry import (
    LONGEST,
    SHORTEST,
    Backoff,
    give_up,
    is_refusal,
)

BROKER = MqttBroker(host="house", username="neuro", password_env="P", patience=3)
GONE = aiomqtt.MqttError("gone")


def refusal(text: str) -> aiomqtt.MqttCodeError:
    return aiomqtt.MqttCodeError(ReasonCode(PacketTypes.CONNACK, text))


@given(seed=st.integers(0, 2**32), count=st.integers(1, 20))
def test_delays_double_up_to_the_longest_and_are_cut_by_half_at_most(
    seed: int, count: int
) -> None:
    backoff = Backoff(random.Random(seed))
    for attempt in range(count):
        full = min(SHORTEST * 2**attempt, LONGEST)
        assert full / 2 <= backoff.delay() <= full
        backoff.failed(GONE, lasted=1.0)


def test_only_a_connection_that_lasted_starts_over() -> None:
    backoff = Backoff(random.Random(0))
    for _ in range(10):
        backoff.delay()
    backoff.failed(GONE, lasted=LONGEST)
    assert backoff.delay() >= LONGEST / 2
    backoff.failed(GONE, lasted=LONGEST + 1)
    assert backoff.delay() <= SHORTEST


@pytest.mark.parametrize("text", ["Bad user name or password", "Not authorized"])
def test_a_refusal_is_not_asked_again_in_haste(text: str) -> None:
    backoff = Backoff(random.Random(0))
    backoff.failed(refusal(text), lasted=0.1)
    assert backoff.delay() >= LONGEST / 2


def test_a_number_of_the_client_library_is_no_refusal() -> None:
    assert not is_refusal(aiomqtt.MqttCodeError(5))
    assert not is_refusal(refusal("Server busy"))


def test_a_refusal_ends_a_start_at_once() -> None:
    with pytest.raises(
        InvalidValueError,
        match=r"^username: must be taken by house:1883, with its password .*'neuro'$",
    ):
        give_up(BROKER, refusal("Not authorized"), late=False)


def test_a_certificate_that_is_not_trusted_ends_a_start_at_once() -> None:
    error = aiomqtt.MqttError("bad")
    error.__context__ = ssl.SSLCertVerificationError(1, "self-signed certificate")
    with pytest.raises(
        InvalidValueError, match=r"^broker: must have a certificate that"
    ):
        give_up(BROKER, error, late=False)


def test_anything_else_ends_a_start_when_the_patience_is_over() -> None:
    give_up(BROKER, GONE, late=False)
    with pytest.raises(
        NeurosnapError,
        match=r"^broker: must answer within 3 s, got nothing from house:1883 \(gone\)$",
    ):
        give_up(BROKER, GONE, late=True)
