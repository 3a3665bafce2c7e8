"""What a broker retains."""

from tests.support.mosquitto import Mosquitto, peer


async def kept(broker: Mosquitto, topic: str, last: str) -> dict[str, bytes]:
    """What the broker retains below `topic`, after it has retained `last`."""
    async with peer(broker, last) as other:
        await anext(other.messages)
    async with peer(broker, topic) as other:
        # Its own comes after all that was retained.
        await other.publish(f"{topic[:-1]}mark", b"", qos=1)
        found = {}
        async for message in other.messages:
            if not message.retain:
                break
            found[message.topic.value] = message.payload
        return found


async def left(broker: Mosquitto) -> dict[str, bytes]:
    """All that the broker retains."""
    async with peer(broker, "#") as other:
        await other.publish("mark", b"", qos=1)
        found = {}
        async for message in other.messages:
            if not message.retain:
                break
            found[message.topic.value] = message.payload
    return found
