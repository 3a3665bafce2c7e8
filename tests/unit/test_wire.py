"""Every message survives encoding and decoding; invalid ones are refused."""

from collections.abc import Callable
from typing import Any

import msgspec.inspect as kinds
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.fabric.in_memory import matches

KINDS = sorted(set(wire.TOPICS.values()), key=lambda kind: kind.__name__)


def values(kind: kinds.Type) -> st.SearchStrategy[Any]:
    """Draw what a field may hold."""
    match kind:
        case kinds.IntType():
            return st.integers(kind.ge, kind.le)
        case kinds.FloatType():
            if kind.ge is None:
                return st.floats(allow_nan=False, allow_infinity=False)
            return st.floats(kind.ge, kind.le or kind.lt, exclude_max=kind.le is None)
        case kinds.VarTupleType():
            return st.lists(values(kind.item_type), max_size=5).map(tuple)
        case kinds.LiteralType():
            return st.sampled_from(kind.values)
        case kinds.BytesType():
            return st.binary(max_size=40)
        case kinds.MemoryViewType():
            return st.binary(max_size=40).map(memoryview)
        case kinds.StrType():
            return st.text(max_size=20)
        case kinds.StructType():
            fields = {field.name: values(field.type) for field in kind.fields}
            return st.builds(kind.cls, **fields)
        case kinds.BoolType():
            return st.booleans()
        case _:
            raise NotImplementedError(kind)


def structs(kind: type[wire.Message]) -> st.SearchStrategy[wire.Message]:
    """Draw messages of one kind, all fields given."""
    info = kinds.type_info(kind)
    assert isinstance(info, kinds.StructType)
    fields = {f.name: values(f.type) for f in info.fields}
    for field in info.fields:
        if field.name in ("who", "to") and isinstance(field.type, kinds.StrType):
            part = r"[a-z]{1,20}(/[a-z0-9]{1,20})?"
            fields[field.name] = st.from_regex(part, fullmatch=True)
    return st.builds(kind, **fields)


messages = st.one_of([structs(kind) for kind in KINDS])


@given(messages)
def test_a_message_comes_back_as_it_went(message: wire.Message) -> None:
    back = wire.decode(message.key, wire.encode(message))
    assert back == message
    assert type(back) is type(message)


@given(messages)
def test_a_part_says_what_it_may_say_under_its_own_name(message: wire.Message) -> None:
    assert wire.TOPICS[wire.topic(message.key)] is type(message)
    may = wire.said_by(message.sender, wire.topic(message.key))
    assert matches(may, message.key)
    match message:
        case wire.Observation() | wire.Image():
            assert message.sender == "world"
        case wire.Pulse():
            assert message.sender == f"cell/{message.source // 2}"
        case wire.CellReport():
            assert message.sender == f"cell/{message.cell}"
        case wire.PulseBatch() | wire.WorkerReport() | wire.Learned():
            assert message.sender == f"worker/{message.worker}"
        case wire.Fault() | wire.Leave() | wire.Recalled() | wire.Band():
            assert message.sender == message.who
        case _:
            assert message.sender == "coordinator"


@given(message=messages, other=st.sampled_from(sorted(wire.TOPICS)))
def test_a_message_under_another_key_is_refused(
    message: wire.Message, other: str
) -> None:
    key = f"{other}/x"
    assume(key != message.key)
    with pytest.raises(MessageError, match=rf"^{key}: must hold its own messages, got"):
        wire.decode(key, wire.encode(message))


SENT_BY_MANY = [
    wire.Pulse(wave=1, source=7, target=4, hops=1, credit=0),
    wire.CellReport(1, 3, 0, (6,), (2,), (3,), 1),
    wire.PulseBatch(1, 3, 1, 0, b"", b"", b"", b""),
    wire.WorkerReport(1, 3, 0, b"", b"", (0,), 0),
    wire.Fault("cell/3", "no"),
    wire.Leave("worker/3"),
]


@pytest.mark.parametrize("message", SENT_BY_MANY, ids=lambda m: type(m).__name__)
def test_a_payload_that_names_another_sender_than_its_key_is_refused(
    message: wire.Message,
) -> None:
    honest = message.key
    assert honest.endswith(f"/{message.sender}")
    assert wire.decode(honest, wire.encode(message)) == message
    for other in ("cell/4", "worker/4", "coordinator", "cell/*"):
        key = honest.removesuffix(message.sender) + other
        with pytest.raises(MessageError, match="must hold its own messages, got one"):
            wire.decode(key, wire.encode(message))


@pytest.mark.parametrize("who", ["*", "cell/*", "**", "", "a//b", "cell/3/", "Cell/3"])
@pytest.mark.parametrize("kind", [wire.Leave, lambda who: wire.Fault(who, "no")])
def test_what_is_no_parts_name_is_nobodys(
    who: str, kind: Callable[[str], wire.Message]
) -> None:
    message = kind(who)
    with pytest.raises(MessageError, match="must be of a part such as cell/3, got"):
        wire.decode(message.key, wire.encode(message))


@given(messages, st.data())
def test_a_damaged_payload_is_a_message_error_or_a_message(
    message: wire.Message, data: st.DataObject
) -> None:
    payload = bytearray(wire.encode(message))
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.integers(0, len(payload) - 1))
        payload[place] = data.draw(st.integers(0, 255))
    try:
        found = wire.decode(message.key, bytes(payload))
    except MessageError:
        return
    assert found.key == message.key


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"null",
        b"[]",
        b"{}",
        b'{"type":"nobody"}',
        b'{"type":"pulse"}',
        b'{"type":"leave","who":"\xff\xfe"}',
        b'{"type":"observation","tick":0,"bits":""}',
        b'{"type":"observation","tick":1,"bits":"not base64"}',
        b'{"type":"observation","tick":2147483648,"bits":""}',
        b'{"type":"observation","tick":1.5,"bits":""}',
        b'{"type":"observation","tick":NaN,"bits":""}',
        b'{"type":"observation","tick":1,"bits":"","outages":[{"since":0,"until":1e300,'
        b'"why":""}]}',
        b'{"type":"observation","tick":' + b"9" * 10_000 + b',"bits":""}',
        b"[" * 100_000,
    ],
    ids=lambda payload: repr(payload[:40]),
)
def test_what_breaks_a_rule_is_a_message_error(payload: bytes) -> None:
    with pytest.raises(MessageError, match=r"^observation: must hold a message, got "):
        wire.decode("observation", payload)


def test_an_unknown_field_is_ignored_so_that_later_schemas_stay_readable() -> None:
    payload = b'{"type":"leave","who":"world","since":7}'
    assert wire.decode("leave/world", payload) == wire.Leave("world")


FOR_ALL: list[wire.Message] = [
    wire.Observation(1, b""),
    wire.WaveStart(1, 0, "signal", 0, 1),
    wire.Recall(1, 1),
]
FOR_CELL_3: list[wire.Message] = [
    wire.Wiring(3, 1, 0),
    wire.WaveStart(2, 0, "signal", 0, 1, fence=1, cell=3),
    wire.Pulse(1, 0, 6, 1, 0),
    wire.Pulse(1, 0, 7, 1, 0),
    wire.Recall(1, 1, cell=3),
    wire.Reminder("cell/3", 1, 64, (3,), b"", b""),
]
FOR_WORKER_1: list[wire.Message] = [
    wire.WorkerWiring(1, 1, 0),
    wire.PulseBatch(1, 0, 1, 0, b"", b"", b"", b""),
    wire.Reminder("worker/1", 1, 64, (3,), b"", b""),
]


@pytest.mark.parametrize(
    ("keys", "own", "others"),
    [
        (wire.cell_keys(3), FOR_CELL_3, wire.cell_keys(2)),
        (
            wire.worker_keys(1, learns=False),
            FOR_WORKER_1,
            wire.worker_keys(0, learns=False),
        ),
    ],
)
def test_a_part_listens_to_what_is_for_it_and_to_nothing_else(
    keys: tuple[str, ...], own: list[wire.Message], others: tuple[str, ...]
) -> None:
    for message in (*FOR_ALL, *own):
        assert any(matches(key, message.key) for key in keys)
    for message in own:
        assert not any(matches(key, message.key) for key in others)


def test_numbers_are_four_bytes_each_and_signed() -> None:
    assert wire.numbers("hops", b"\1\0\0\0" + b"\xff" * 4) == (1, -1)
    with pytest.raises(
        MessageError, match=r"^hops: must be four bytes a number, got 5$"
    ):
        wire.numbers("hops", bytes(5))


@pytest.mark.parametrize(("data", "count"), [(b"abc", 2), (b"abc", 0)])
def test_rings_of_different_sizes_are_refused(data: bytes, count: int) -> None:
    rule = rf"field: must hold {count} rings of the same size, got 3 bytes"
    with pytest.raises(MessageError, match=rule):
        wire.split_rings("field", data, count)
