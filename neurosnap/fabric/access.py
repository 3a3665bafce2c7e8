"""Who may say and hear what in a swarm: one table, and the hub's access list from it.

Whatever the table does not allow is denied, to known roles and to strangers. A role is
the common name of a certificate, so the list means something under mutual TLS only. It
tells roles apart and not the parts of one role: a cell cannot rewire anybody, but it
can send what any other cell may send, and say any part's last word (``leave``).
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Literal, NamedTuple, TypeAlias, get_args

from neurosnap import wire
from neurosnap.errors import InvalidValueError

Role: TypeAlias = Literal[
    "hub", "coordinator", "world", "recorder", "cell", "worker", "watcher", "sensor"
]
ROLES: tuple[Role, ...] = get_args(Role)

ALL = tuple(wire.TOPICS)
"""Every topic."""

READING = "reading"
"""Where programs outside put what their sensors read: no message of ours."""


class Rights(NamedTuple):
    """What one role may do."""

    publishes: tuple[str, ...] = ()
    """Topics it may send to."""
    reads: tuple[str, ...] = ()
    """Topics it may listen to; `ALL` also allows one subscription to everything."""
    announces: tuple[str, ...] = ()
    """Names it may show as alive, and the place of, as key expressions."""
    watches: bool = False
    """It may follow who is alive, and where."""
    briefs: bool = False
    """It answers what the run is."""
    asks: bool = False
    """It may ask that."""
    told: bool = False
    """It is told who listens to what it publishes: a stock client's declared publisher
    sends nothing as long as it knows of nobody. Ours do not ask."""


def _topics(keys: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(wire.topic(key) for key in keys))


RIGHTS: dict[Role, Rights] = {
    # Plays recordings back, over a session beside the router's own.
    "hub": Rights(publishes=ALL),
    "coordinator": Rights(
        publishes=(
            *("wiring", "loom", "wave", "state", "reach", "decide"),
            *("keyframe", "anomaly", "fault", "leave"),
        ),
        reads=("observe", "settle", "tally", "fault", "leave"),
        announces=("coordinator",),
        watches=True,
        briefs=True,
    ),
    "world": Rights(
        publishes=("observe", "fault", "leave"),
        reads=("state", "decide", READING),
        announces=("world",),
    ),
    "recorder": Rights(
        publishes=("fault",), reads=ALL, announces=("recorder",), watches=True
    ),
    "cell": Rights(
        publishes=("excite", "inhibit", "settle", "fault", "leave"),
        reads=_topics(wire.cell_keys(0)),
        announces=("cell/*",),
    ),
    "worker": Rights(
        publishes=("burst", "tally", "fault", "leave"),
        reads=_topics(wire.worker_keys(0)),
        announces=("worker/*",),
    ),
    # Looks on, and leaves no trace.
    "watcher": Rights(reads=ALL, watches=True, asks=True),
    # Any program that knows something, and nothing of ours.
    "sensor": Rights(publishes=(READING,), told=True),
}

BRIEF = "brief"
"""What a coordinator answers to whoever wants to take part in its run."""

PLACE = "place"
"""Below it parts of a swarm on several machines show where they are: as what follows
who it is, in ``place/cell/3/oak/4711``."""

FLUSHED = "flushed"
"""What every part asks for at its end; the hub itself answers that nobody has it."""

_EVERY = f"{wire.ROOT}/*/"  # below any swarm's prefix


def role_of(who: str) -> Role:
    """Return the role of the part `who`, as in ``cell/3``.

    Raises:
        InvalidValueError: There is no such role.
    """
    kind = who.partition("/")[0]
    for role in ROLES:
        if role == kind:
            return role
    raise InvalidValueError("part", f"must be of {', '.join(ROLES)}", who)


def access_list() -> dict[str, object]:
    """Return Zenoh's ``access_control``: `RIGHTS`, and nothing else.

    A flow is seen from the hub: what comes in was sent or asked for by the role, what
    goes out is what the role gets. A rule's key has to include the key in question.
    """
    rules: list[dict[str, object]] = []
    policies: list[dict[str, object]] = []
    for role, rights in RIGHTS.items():
        own = list(_rules(role, rights))
        rules += own
        policies.append({"rules": [rule["id"] for rule in own], "subjects": [role]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": role, "cert_common_names": [role]} for role in RIGHTS],
        "policies": policies,
    }


def _rules(role: Role, rights: Rights) -> Iterator[dict[str, object]]:
    """Yield the rules of one role."""
    reads = ("**",) if rights.reads == ALL else _below(rights.reads)
    alive = tuple(f"alive/{who}" for who in rights.announces)
    places = tuple(f"{PLACE}/{who}/*/*" for who in rights.announces)
    everybody = ("alive/**", f"{PLACE}/**") if rights.watches else ()
    answers = (BRIEF,) if rights.briefs else ()
    asks = (BRIEF,) if rights.asks else ()
    publishes = _below(rights.publishes)
    for message, flow, keys in (
        ("put", "ingress", publishes),
        ("declare_subscriber", "egress", publishes if rights.told else ()),
        ("declare_subscriber", "ingress", reads),
        ("put", "egress", reads),
        ("liveliness_token", "ingress", alive + places),
        ("declare_liveliness_subscriber", "ingress", everybody),
        ("liveliness_query", "ingress", everybody),
        ("liveliness_token", "egress", everybody),
        ("declare_queryable", "ingress", answers),
        ("query", "egress", answers),
        ("reply", "ingress", answers),
        ("reply", "egress", asks),
        ("query", "ingress", (FLUSHED, *asks)),
    ):
        if keys:
            yield {
                "id": f"{role} {message} {flow}",
                "permission": "allow",
                "messages": [message],
                "flows": [flow],
                "key_exprs": [_EVERY + key for key in keys],
            }


def _below(topics: Sequence[str]) -> tuple[str, ...]:
    """Return key expressions for `topics`: the topic itself, and what is below it."""
    return tuple(f"{topic}/**" for topic in topics)
