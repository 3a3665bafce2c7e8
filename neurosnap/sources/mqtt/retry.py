"""Reconnection delays, and errors after which there is no retry."""

import random
import ssl

import aiomqtt
from paho.mqtt.reasoncodes import ReasonCode

from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.sources.mqtt.options import MqttBroker

SHORTEST, LONGEST = 0.5, 30.0
"""Seconds before the first and the last attempt to connect again, before jitter."""

_REFUSED = {134, 135}  # name or password; paho says so for 4 and 5 of MQTT 3.1.1, too


class Backoff:
    """Delays that double, each shortened by up to a half so that clients part.

    Args:
        rng: Draws the jitter.
    """

    def __init__(self, rng: random.Random) -> None:
        self._rng = rng
        self._next = SHORTEST

    def delay(self) -> float:
        """Return the seconds to wait before the next attempt."""
        delay = self._next
        self._next = min(2 * delay, LONGEST)
        return delay * self._rng.uniform(0.5, 1.0)

    def failed(self, error: Exception, lasted: float) -> None:
        """Take note of how a connection ended.

        Args:
            error: Of what.
            lasted: Seconds since it was tried. Only a connection that lasted starts
                over with the shortest delay: a broker may let in and drop at once.
        """
        if lasted > LONGEST:
            self._next = SHORTEST
        if is_refusal(error):
            self._next = LONGEST  # asking often does not help, and may lock an account


def is_refusal(error: Exception) -> bool:
    """Whether the broker does not want this name with this password."""
    # Plain numbers are the client library's own, and 5 is another thing there.
    return (
        isinstance(error, aiomqtt.MqttCodeError)
        and isinstance(error.rc, ReasonCode)
        and error.rc.value in _REFUSED
    )


def explained(broker: MqttBroker, error: Exception) -> Exception:
    """Return what is wrong in words that name it, where trying again is no help.

    Args:
        broker: Who was to be connected to.
        error: Why it could not be.

    Returns:
        An `InvalidValueError` that names what the broker or we do not accept, never
        the password; `error` itself where it may be better next time.
    """
    if is_refusal(error):
        rule = f"must be taken by {broker.address}, with its password ({error})"
        return InvalidValueError("username", rule, broker.username)
    # The library keeps only the text, and Python what it was made of.
    if isinstance(error.__context__, ssl.SSLCertVerificationError):
        rule = f"must have a certificate that is trusted ({error})"
        return InvalidValueError("broker", rule, broker.address)
    return error


def give_up(broker: MqttBroker, error: Exception, *, late: bool) -> None:
    """Raise what a start fails of, if it is to fail.

    Args:
        broker: Who was to be connected to.
        error: Why it could not be.
        late: The patience is over.

    Raises:
        InvalidValueError: It will not be better next time.
        NeurosnapError: It may be, but it took too long.
    """
    named = explained(broker, error)
    if named is not error:
        raise named from error
    if isinstance(error, InvalidValueError):
        raise error
    if late:
        within = f"must answer within {broker.patience:g} s"
        raise NeurosnapError(
            f"broker: {within}, got nothing from {broker.address} ({error})"
        ) from error
