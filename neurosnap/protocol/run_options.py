"""The options of a run: enough to repeat it; stored in its recording."""

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, TypeAlias

import msgspec

from neurosnap.agent.body import Body
from neurosnap.agent.memory import AgentMemory
from neurosnap.agent.policy import EXACT, EXPLORE, AgentKind, Policy
from neurosnap.agent.policy_kinds import new_policy, preferences
from neurosnap.errors import InvalidValueError
from neurosnap.health.alarm_budget import NEVER, parse_budget
from neurosnap.health.follower import Follower
from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.poc.order.graph import (
    WiringKind as WiringKind,  # one of the options' kinds
)
from neurosnap.protocol.option_declaration import option
from neurosnap.protocol.worker_learning import WorkerLearning
from neurosnap.protocol.worker_shares import hosts, learning_shares, shares
from neurosnap.sensorium import Sensorium
from neurosnap.sources.conditions import Condition
from neurosnap.sources.cuts import known_order, recorded_conditions
from neurosnap.sources.meaning import compared, numbers_in
from neurosnap.sources.mqtt import options as mqtt
from neurosnap.sources.ros2 import options as ros2

SMALLEST = 1 << 16
"""Least bytes per file of a split recording: with fewer a file would hold little but
its header."""
FOREVER = 2**31 - 1
"""Ticks of a run that ends when it is told to: the most a message can say."""
SnapshotKind: TypeAlias = Literal["empirical", "discounted"]
HostKind: TypeAlias = Literal["process", "worker"]
CellKind: TypeAlias = Literal["process", "worker", "inline"]
FEW_CELLS = 64
"""Cells up to this number are a process each, unless told otherwise."""

_FEW = 100
"""Sensors: with more, Python takes too long for what Numba would compile. So it does to
search all readings for what may be grown, with however few."""
_BRIEFLY = 5.0  # seconds; to compile takes three times as long


class RunOptions(msgspec.Struct, frozen=True, kw_only=True):
    """The options of one run.

    A field with an `option` is declared here alone: the TOML tables, their schema and
    the command line are made from it.
    """

    source: str
    """A Gymnasium environment's id, or the path of a CSV file of readings."""
    arguments: dict[str, bool | int | float | str] = {}
    """What the environment is made with."""
    body: Body
    """What is sensed and done: a cell for every sensor of it."""
    agent: Annotated[
        AgentKind,
        option(
            "Who chooses the actions. A walker acts at random, an excited agent"
            " moves towards a place, a planner plans its way to what `target` names.",
            at="agent.kind",
            flag="agent",
        ),
    ] = "walker"
    target: tuple[str, ...] = ()
    """What a planner wants to sense, by name."""
    prefer: Annotated[
        str,
        option(
            "For a planner that imagines and grows sensors, instead of a target: what"
            " it is worth to sense something, each time (won=1,lost=-1).",
            at="agent.prefer",
            unit="SENSOR=WORTH,...",
        ),
    ] = ""
    explore: Annotated[
        Annotated[float, msgspec.Meta(ge=0, le=1)] | Literal["planned"],
        option(
            "Share of actions that are random all the same, from 0 to 1; a walker's"
            " all are. Or the word planned, with `imagine`: go to the nearest action"
            " whose outcome is unknown, unless there is a way to the target.",
            at="agent.explore",
            unit="SHARE",
        ),
    ] = EXPLORE
    imagine: Annotated[
        int,
        option(
            "How many states a planner may imagine for a decision, by waves through"
            " what it has learned; 2000 is plenty. It needs no target then: without"
            " one it explores. 0: it looks one step ahead.",
            at="agent.imagine",
            unit="STATES",
            ge=0,
        ),
    ] = 0
    ticks: Annotated[
        int,
        option(
            "How many observations to take, at most.",
            at="run.ticks",
            default="300; of a CSV file, all; from outside, until Ctrl-C",
            ge=1,
            le=FOREVER,
            flag="ticks",
        ),
    ] = 300
    seed: Annotated[
        int,
        option(
            "Seed of all random numbers: the world's start, its fields and the"
            " random actions. The same seed gives the same run of a world.",
            at="run.seed",
            ge=0,
            le=2**63 - 1,
            flag="seed",
        ),
    ] = 0
    snapshot: Annotated[
        SnapshotKind,
        option(
            "How to learn. Empirical: count, and forget nothing. Discounted: forget"
            " slowly, so that habits may change.",
            at="snapshot.kind",
            flag="snapshot",
        ),
    ] = "empirical"
    threshold: (
        Annotated[
            Annotated[float, msgspec.Meta(gt=0, le=0.25)] | Literal["auto"],
            option(
                "How rare the exceptions to an implication must be, as a share of"
                " all ticks: above 0, up to 0.25. Greater: more implications, and"
                " more wrong ones. Or the word auto: each pair of sensors chooses"
                f" its own, from how surely its exceptions are rare; but {EXACT:.5f}"
                " for a planner or an excited agent in a discrete world. Not for a"
                " discounted snapshot.",
                at="snapshot.threshold",
                unit="SHARE",
                default=f"auto; discounted, {DiscountedSnapshot.THRESHOLD:g}",
                flag="threshold",
            ),
        ]
        | None
    ) = None
    """None for a discounted snapshot: its own default."""
    decay: (
        Annotated[
            float,
            option(
                "Of a discounted snapshot: how much of the past is kept at each"
                " tick, from 0 to below 1.",
                at="snapshot.decay",
                default=f"{DiscountedSnapshot.DECAY:g}",
                ge=0,
                lt=1,
            ),
        ]
        | None
    ) = None
    """None for the snapshot's own default."""
    wiring: Annotated[
        WiringKind,
        option(
            "Which implications are connections between cells. Hasse: only those"
            " that do not follow from others (fewer messages). Derived: all (fewer"
            " hops).",
            at="cells.wiring",
        ),
    ] = "hasse"
    cells: CellKind = "process"
    workers: Annotated[int, msgspec.Meta(ge=0)] = 2
    """How many workers share the cells. An inline run has one at
    most; with 0 each of its cells is a part of the swarm, as cells in processes are."""
    keyframe_every: Annotated[
        int,
        option(
            "How often to record all that was learned, for a replay or a restart to"
            " begin there; after 32,768 waves in any case. Fewer ticks: a larger"
            " recording, and a faster start from within it.",
            at="recording.keyframe_every",
            unit="TICKS",
            ge=1,
        ),
    ] = 1000
    frames: Annotated[
        int,
        option(
            "Record an image each so many ticks, from the first on, as a Gymnasium"
            " environment draws itself (render mode rgb_array). 0: none. Needs"
            " Pillow.",
            at="recording.frames",
            unit="TICKS",
            ge=0,
        ),
    ] = 0
    split: Annotated[
        int,
        option(
            "Begin another file once one has this many bytes; on the command line"
            " 256MiB is understood, too. 0: record in one file.",
            at="recording.split",
            unit="SIZE",
            ge=0,
        ),
    ] = 0
    keep: Annotated[
        int,
        option(
            "With `split`: keep this many of the newest files and delete the others."
            " 0: keep all.",
            at="recording.keep",
            unit="FILES",
            ge=0,
        ),
    ] = 0
    sync: Annotated[
        float,
        option(
            "How often to force the recording to the disk, against a power cut. 0:"
            " only at the end.",
            at="recording.sync",
            unit="SECONDS",
            default="1 for readings from outside, else 0",
            ge=0,
        ),
    ] = 0.0
    watch: Annotated[
        bool,
        option(
            "Record each observation that contradicts what was learned before it;"
            " `neurosnap watch` shows them.",
            at="anomalies.watch",
        ),
    ] = False
    hold: Annotated[
        int,
        option(
            "After an anomaly, judge this many more ticks by what was learned before"
            " it, so that a lasting fault is reported as long as it lasts. 0: it is"
            " reported when it begins, and may be learned as normal then.",
            at="anomalies.hold",
            unit="TICKS",
            ge=0,
        ),
    ] = 0
    support: Annotated[
        int,
        option(
            "Report only anomalies that break an implication which was put to the"
            " test, and held, on this many occasions, each way. The recording has all"
            " of them. 0: report all, and count no occasions.",
            at="anomalies.support",
            unit="OCCASIONS",
            ge=0,
        ),
    ] = 10
    alarms: Annotated[
        str,
        option(
            "How many alarms about broken sensors may be raised while nothing is"
            " wrong, such as 1/week or 2/month. Never: no sensor is judged.",
            at="health.alarms",
            unit="N/TIME",
            default="1/week where there are 200 sensors or fewer, read from outside or"
            " from a file with times; else never",
        ),
    ] = NEVER
    health_step: Annotated[
        float,
        option(
            "Judge the sensors as a machine's, in steps of this length: by how much of"
            " each they are on. 0: as a home's, by how often they come on.",
            at="health.step",
            unit="SECONDS",
            ge=0,
            default="0, but for ROS 2, and for files with readings by a clock, or more"
            " often than every ten seconds: the time between two readings, 1 at least",
        ),
    ] = 0.0
    zone: Annotated[
        str,
        option(
            "The home's time zone, such as Europe/Berlin: by its clock times are told,"
            " and it is known what an hour of a workday or weekend is like.",
            at="health.zone",
            default="that of the file; this machine's where the source is read from"
            " outside; else UTC",
        ),
    ] = "UTC"
    deadline: Annotated[
        float,
        option(
            "How long the cells may take to answer before they are asked again.",
            at="cells.deadline",
            unit="SECONDS",
            gt=0,
        ),
    ] = 10.0
    band: Annotated[int, msgspec.Meta(ge=1)] = 1 << 20
    """Numbers that travel in one band of a key-frame, at most: of so many pairs, and
    more, the weights follow it in bands."""

    def __post_init__(self) -> None:
        if self.alarms != NEVER:
            parse_budget(self.alarms)
        if 0 < self.split < SMALLEST:
            rule = f"must be 0, or at least {SMALLEST} bytes"
            raise InvalidValueError("split", rule, self.split)
        if self.keep and not self.split:
            raise InvalidValueError("keep", "must come with split", self.keep)
        if self.keep and self.body.actions:
            # A run that goes on after a death does all of them again.
            rule = "must go with a source that takes no actions"
            raise InvalidValueError("keep", rule, self.keep)

    @property
    def sensors(self) -> tuple[str, ...]:
        """The sensors' names, in order."""
        return self.body.sensors

    def new_policy(self, memory: AgentMemory) -> Policy:
        """Return the policy that decides, by what a memory knows.

        Raises:
            InvalidValueError: The body or the target is not fit for such an agent.
        """
        return new_policy(
            self.agent,
            self.body,
            self.seed,
            target=self.target,
            prefer=preferences(self.prefer),
            explore=self.explore,
            imagine=self.imagine,
            experience=memory.experience,
        )

    def new_memory(self) -> AgentMemory:
        """Return what the agent knows besides the snapshot when the run starts.

        Raises:
            InvalidValueError: The body has room for sensors to be grown, and is not fit
                for it.
        """
        return AgentMemory(self.body, imagines=self.imagine > 0)

    @property
    def sharing(self) -> int:
        """How many workers share the cells; 0 if every cell is a part by itself.

        Raises:
            InvalidValueError: There are more workers than cells.
        """
        match self.cells:
            case "worker":
                return len(shares(len(self.sensors), self.workers))
            case "inline":
                return min(1, self.workers)
            case "process":
                return 0

    def host_names(self) -> list[str]:
        """Return the names of the parts that cells are, or are hosted by, in order."""
        return hosts(len(self.sensors), self.sharing)

    @property
    def learning_shares(self) -> list[range]:
        """The sensors whose pairs with those before them each worker learns.

        Empty where the coordinator learns, as the cells are in no workers.
        """
        if self.cells != "worker":
            return []
        return learning_shares(len(self.sensors), self.sharing)

    def new_worker_learning(self, worker: int) -> WorkerLearning | None:
        """Return what a worker learns when the run starts; None if nothing."""
        if not (shares := self.learning_shares):
            return None
        snapshot = self.new_snapshot(shares[worker])
        return WorkerLearning(worker, snapshot, self.band)

    @property
    def known_order(self) -> tuple[tuple[int, int], ...]:
        """Which literals imply which by the cuts of their signals; see `sources.cuts`.

        Raises:
            InvalidValueError: The source's arguments hold cuts that are none.
        """
        return tuple(known_order(self.body.own, self.conditions))

    def follower(self) -> Follower:
        """Return who follows the health of the world's own sensors."""
        conditions = self.conditions if self.arguments else {}
        budget = self.alarms, self.zone, self.health_step
        return follower_of(self.body.own, conditions, *budget)

    @property
    def conditions(self) -> dict[str, Condition]:
        """When the sensors of signals are on, by name; raises as `known_order`."""
        text = str(self.arguments.get("options"))
        match self.source:
            case "mqtt:":
                return mqtt.conditions_of(
                    msgspec.json.decode(text, type=mqtt.MqttOptions)
                )
            case "ros2:":
                return ros2.conditions_of(
                    msgspec.json.decode(text, type=ros2.Ros2Options)
                )
            case _:
                return recorded_conditions(self.arguments)

    @property
    def interpreted(self) -> float:
        """For how many seconds a coordinator compiles nothing; 0: it does at once.

        Where few cells have a process each, a tick takes many times as long as what the
        coordinator computes in it.
        """
        return math.inf if self.briefly and self.cells == "process" else 0.0

    @property
    def briefly(self) -> float:
        """For how many seconds nothing is compiled to derive such a run again."""
        few = len(self.sensors) <= _FEW and not self.body.room
        return _BRIEFLY if few else 0.0

    def new_snapshot(self, share: range | None = None) -> Snapshot:
        """Return the snapshot the run starts with; a share is as of `Snapshot`.

        Raises:
            InvalidValueError: The threshold or the decay is out of range, or a decay is
                given for a snapshot that has none.
        """
        sensorium = Sensorium(self.sensors)
        if self.snapshot == "discounted":
            return DiscountedSnapshot(sensorium, **self.in_force, share=share)
        if self.decay is not None:
            rule = "must go with a discounted snapshot only"
            raise InvalidValueError("decay", rule, self.decay)
        return EmpiricalSnapshot(sensorium, **self.in_force, share=share)

    @property
    def in_force(self) -> dict[str, Any]:
        """The threshold, and of a discounted snapshot the decay, given or not."""
        usual: dict[str, Any] = {"threshold": EmpiricalSnapshot.THRESHOLD}
        if self.snapshot == "discounted":
            kind = DiscountedSnapshot
            usual = {"threshold": kind.THRESHOLD, "decay": kind.DECAY}
        given = {name: getattr(self, name) for name in usual}
        return usual | {name: one for name, one in given.items() if one is not None}


def follower_of(
    names: Sequence[str],
    conditions: Mapping[str, Condition],
    alarms: str,
    zone: str,
    step: float,
) -> Follower:
    """Return who follows sensors' health; those of signals are on by `conditions`.

    The other arguments, and the errors, are those of `Follower`.
    """
    alike = [(a >> 1, b >> 1) for a, b in known_order(names, conditions)]
    places = compared(map(conditions.get, names))
    return Follower(
        names, alarms, zone, step, alike, lambda said: numbers_in(said, places)
    )
