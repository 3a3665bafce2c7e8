"""Frames as the page gets them of a run under way: as differences."""

import msgspec
from msgspec import UNSET, UnsetType

from neurosnap.agent.growth.changed import Changed
from neurosnap.apps.viewer.api import Anomaly, Bit, Frame, Plan, Thing, Wave


class Change(msgspec.Struct, frozen=True, kw_only=True):
    """A `Frame` as the difference against another.

    What is not there is as it was; `bits` and `state` list sensors with what they are
    now.
    """

    tick: int
    after: int
    """The tick of the frame that this is a difference against; 0: of none, and then all
    is there, `bits` and `state` for every sensor."""
    bits: list[tuple[int, Bit]] | UnsetType = UNSET
    state: list[tuple[int, Bit]] | UnsetType = UNSET
    contradicted: list[int] | UnsetType = UNSET
    action: str | UnsetType | None = UNSET
    choice: int | UnsetType = UNSET
    why: str | UnsetType = UNSET
    begins: bool | UnsetType = UNSET
    incoherent: bool | UnsetType = UNSET
    depth: int | UnsetType = UNSET
    longest: int | UnsetType = UNSET
    height: int | UnsetType = UNSET
    edges: int | UnsetType = UNSET
    pulses: int | UnsetType = UNSET
    graph: str | UnsetType = UNSET
    place: int | UnsetType | None = UNSET
    heading: str | UnsetType = UNSET
    things: list[Thing] | UnsetType = UNSET
    image: int | UnsetType | None = UNSET
    waves: list[Wave] | UnsetType = UNSET
    left_out: int | UnsetType = UNSET
    sensors: int | UnsetType = UNSET
    retired: list[int] | UnsetType = UNSET
    changed: list[Changed] | UnsetType = UNSET
    plan: Plan | UnsetType | None = UNSET
    anomaly: Anomaly | UnsetType | None = UNSET


class Event(msgspec.Struct, frozen=True, kw_only=True):
    """What is new in a recording that grows; at most ten a second.

    The first of a stream has the newest frame, those after it the newest of the frames
    since. Who wants all of them asks for the others. The frame that came last may come
    again, as a difference against itself, once more is known of it.
    """

    ticks: int
    """As in `Run`."""
    live: bool
    """As in `Run`; after an event without it the stream ends."""
    cut: str | None
    """As in `Run`."""
    reset: bool
    """It is another recording than before, of the same run: it went on after a part
    had died. What is known of it has to be asked for again."""
    frames: list[Change]


def difference(before: Frame | None, now: Frame) -> Change:
    """Return a frame as the difference against another of the same run."""
    if before is None:
        fields = msgspec.structs.asdict(now)
        whole = {name: list(enumerate(fields[name])) for name in ("bits", "state")}
        return Change(**{**fields, **whole, "after": 0})
    changed: dict[str, object] = {}
    for name in Frame.__struct_fields__:
        was, is_now = getattr(before, name), getattr(now, name)
        if was == is_now:
            continue
        if name in ("bits", "state"):
            pairs = enumerate(zip(was, is_now, strict=True))
            changed[name] = [(k, new) for k, (old, new) in pairs if old != new]
        else:
            changed[name] = is_now
    return msgspec.convert({**changed, "tick": now.tick, "after": before.tick}, Change)
