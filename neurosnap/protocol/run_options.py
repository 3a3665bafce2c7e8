"""The options of a run: enough to repeat it; stored in its recording."""

import math
from typing import Annotated, Literal, TypeAlias

import msgspec

from neurosnap.agent.body import Body
from neurosnap.agent.policies import new_policy
from neurosnap.agent.policy import EXPLORE, AgentKind, Policy
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.kinds import DiscountedSnapshot, EmpiricalSnapshot, Snapshot
from neurosnap.poc.order.graph import (
    WiringKind as WiringKind,  # one of the options' kinds
)
from neurosnap.protocol.partition import hosts, shares
from neurosnap.sensorium import Sensorium
from neurosnap.wire import LARGEST_KEYFRAME

SMALLEST = 1 << 16
"""Least bytes per file of a split recording: with fewer a file would hold little but
its header."""
SnapshotKind: TypeAlias = Literal["empirical", "discounted"]
HostKind: TypeAlias = Literal["process", "worker"]
CellKind: TypeAlias = Literal["process", "worker", "inline"]

_BYTES_A_PAIR: dict[SnapshotKind, int] = {"empirical": 8, "discounted": 13}
"""What a snapshot keeps of two sensors, by its kind."""
_FRAME_BESIDE = 1 << 22  # bytes of a key-frame for the names, and all that is not pairs

Count: TypeAlias = Annotated[int, msgspec.Meta(ge=1)]
Share: TypeAlias = Annotated[float, msgspec.Meta(ge=0, le=1)]
Seed: TypeAlias = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]
Seconds: TypeAlias = Annotated[float, msgspec.Meta(gt=0)]
Threshold: TypeAlias = Annotated[float, msgspec.Meta(gt=0, le=0.25)]
Decay: TypeAlias = Annotated[float, msgspec.Meta(ge=0, lt=1)]


class RunOptions(msgspec.Struct, frozen=True, kw_only=True):
    """The options of one run."""

    source: str
    """A Gymnasium environment's id, or the path of a CSV file of readings."""
    arguments: dict[str, bool | int | float | str] = {}
    """What the environment is made with."""
    body: Body
    """What is sensed and done: a cell for every sensor of it."""
    agent: AgentKind = "walker"
    """Who decides."""
    target: tuple[str, ...] = ()
    """What a planner wants to sense, by name."""
    explore: Share = EXPLORE
    """The share of random actions, where an agent has anything better to do."""
    ticks: Count = 300
    """Observations the run takes, at most."""
    seed: Seed = 0
    """Draws the world's start, its fields and the random actions."""
    snapshot: SnapshotKind = "empirical"
    """How the weights are learned."""
    threshold: Threshold | None = None
    """The learning threshold of every pair; None: the snapshot's own default."""
    decay: Decay | None = None
    """The decay of a discounted snapshot; None: its own default."""
    wiring: WiringKind = "hasse"
    """Which edges carry the pulses."""
    cells: CellKind = "process"
    """One OS process a cell over Zenoh, or one for many, or all in this one over
    memory."""
    workers: Count = 2
    """How many processes share the cells, where one has many."""
    keyframe_every: Count = 1000
    """Ticks between two whole snapshots in the recording."""
    split: Annotated[int, msgspec.Meta(ge=0)] = 0
    """Bytes after which the recording goes on in another file; 0: never."""
    keep: Annotated[int, msgspec.Meta(ge=0)] = 0
    """How many of these files are kept, the newest; 0: all."""
    sync: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    """Seconds after which the recording is on the disk, and survives a power cut; 0:
    once it has its end."""
    watch: bool = False
    """Whether to tell of observations that contradict what is believed."""
    hold: Annotated[int, msgspec.Meta(ge=0)] = 0
    """Ticks to go on judging observations by the order that the first of them broke,
    with `watch`; pays where one exception is enough to give up an implication."""
    deadline: Seconds = 10.0
    """Seconds a wave may take before it is given up and sent again."""

    def __post_init__(self) -> None:
        if 0 < self.split < SMALLEST:
            rule = f"must be 0, or at least {SMALLEST} bytes"
            raise InvalidValueError("split", rule, self.split)
        if self.keep and not self.split:
            raise InvalidValueError("keep", "must come with split", self.keep)
        if self.keep and self.body.actions:
            # Whoever goes on after a death does all of them again.
            rule = "must go with a source that takes no actions"
            raise InvalidValueError("keep", rule, self.keep)

    @property
    def sensors(self) -> tuple[str, ...]:
        """The sensors' names, in order."""
        return self.body.sensors

    def new_policy(self) -> Policy:
        """Return who decides.

        Raises:
            InvalidValueError: The body or the target is not fit for such an agent.
        """
        return new_policy(
            self.agent, self.body, self.seed, target=self.target, explore=self.explore
        )

    @property
    def sharing(self) -> int:
        """How many workers share the cells; 0: every cell is a part of its own.

        Raises:
            InvalidValueError: There are more workers than cells.
        """
        if self.cells != "worker":
            return 0
        return len(shares(len(self.sensors), self.workers))

    def host_names(self) -> list[str]:
        """Return the names of the parts that cells are, or are hosted by, in order."""
        return hosts(len(self.sensors), self.sharing)

    def check_frame(self) -> None:
        """Refuse a run whose key-frames would be too large to be sent.

        They grow with the square of the sensors.

        Raises:
            InvalidValueError: There are too many sensors.
        """
        count, pair = len(self.sensors), _BYTES_A_PAIR[self.snapshot]
        # Base64 takes four bytes for three.
        room = LARGEST_KEYFRAME * 3 // 4 - _FRAME_BESIDE
        if count * count * pair > 2 * room:
            most = math.isqrt(2 * room // pair)
            limit = f"{LARGEST_KEYFRAME >> 20} MiB"
            rule = f"must be at most {most:,}, for a key-frame of {limit}"
            raise InvalidValueError("sensors", rule, count)

    def new_snapshot(self) -> Snapshot:
        """Return the snapshot the run starts with.

        Raises:
            InvalidValueError: The threshold or the decay is out of range, or a decay is
                given for a snapshot that has none.
        """
        sensorium = Sensorium(self.sensors)
        if self.snapshot == "discounted":
            return DiscountedSnapshot(sensorium, **self.in_force)
        if self.decay is not None:
            rule = "must go with a discounted snapshot only"
            raise InvalidValueError("decay", rule, self.decay)
        return EmpiricalSnapshot(sensorium, **self.in_force)

    @property
    def in_force(self) -> dict[str, float]:
        """The threshold, and of a discounted snapshot the decay, given or not."""
        threshold, decay = self.threshold, self.decay
        if self.snapshot == "empirical":
            default = EmpiricalSnapshot.THRESHOLD
            return {"threshold": default if threshold is None else threshold}
        return {
            "threshold": (
                DiscountedSnapshot.THRESHOLD if threshold is None else threshold
            ),
            "decay": DiscountedSnapshot.DECAY if decay is None else decay,
        }
