"""Permissions per role: which keys a part may publish and subscribe.

Whatever the table does not allow is denied, to known names and to strangers. A name is
the common name of a certificate, so the list means something under mutual TLS only. It
is a part's, ``cell/3``, which can speak for that part alone; or a role's, ``cell``,
which can speak for any cell, and for no part of another role.
"""

from collections.abc import Iterable, Iterator, Mapping
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
    """Topics it may listen to, a cell or a worker to what is for it; `ALL` also allows
    one subscription to everything."""
    announces: bool = False
    """It may show itself as alive, and where."""
    passes: bool = False
    """It passes on whatever the others say and hear, either way, and says what others
    said."""
    watches: bool = False
    """It may follow who is alive, and where."""
    briefs: bool = False
    """It answers what the run is."""
    asks: bool = False
    """It may ask that."""
    told: bool = False
    """It is told who listens to what it publishes: a stock client's declared publisher
    sends nothing as long as it knows of no listener. Ours do not ask."""


def _topics(keys: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(wire.topic(key) for key in keys))


RIGHTS: dict[Role, Rights] = {
    # A hub that is linked to another: each holds its own parts to this table. And who
    # plays recordings back, over a session beside the router's own.
    "hub": Rights(passes=True),
    "coordinator": Rights(
        publishes=(
            *("wiring", "workerwiring", "wavestart", "state", "reached", "decision"),
            *("recall", "reminder", "keyframe", "band", "learn"),
            *("anomaly", "fault", "leave"),
        ),
        reads=_topics(wire.COORDINATOR_KEYS),
        announces=True,
        watches=True,
        briefs=True,
    ),
    "world": Rights(
        publishes=("observation", "image", "fault", "leave"),
        reads=("state", "decision", READING),
        announces=True,
    ),
    "recorder": Rights(publishes=("fault",), reads=ALL, announces=True, watches=True),
    "cell": Rights(
        publishes=("pulse", "cellreport", "recalled", "fault", "leave"),
        reads=_topics(wire.cell_keys("*")),
        announces=True,
    ),
    "worker": Rights(
        publishes=(
            "pulsebatch",
            "workerreport",
            "recalled",
            "learned",
            "band",
            "fault",
            "leave",
        ),
        reads=_topics((*wire.worker_keys("*"), *wire.LEARNING_KEYS)),
        announces=True,
    ),
    # Looks on, and leaves no trace.
    "watcher": Rights(reads=ALL, watches=True, asks=True),
    # Any program that knows something, and nothing of ours.
    "sensor": Rights(publishes=(READING,), told=True),
}

DESCRIPTION = "brief"
"""What a coordinator answers to those who want to take part in its run."""

PLACE = "place"
"""Below it parts of a swarm on several machines show where they are: as what follows
who it is, in ``place/cell/3/oak/4711``."""

FLUSHED = "flushed"
"""What every part asks for at its end; the hub itself answers that no part has it."""

MESSAGES = (
    *("put", "declare_subscriber", "query", "declare_queryable", "reply"),
    *("liveliness_token", "declare_liveliness_subscriber", "liveliness_query"),
)
"""What parts send, as Zenoh's rules call it: nothing is ever deleted."""

_EVERY = f"{wire.ROOT}/*/"  # below any swarm's prefix
MANY = ("cell", "worker")
"""Roles of which there are many parts."""
EVERY_ROLE: dict[str, str] = {role: role for role in ROLES}
"""A certificate a role, each under its own name."""


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


def parts_of(name: str) -> str:
    """Return whom a certificate may speak for: a part, or all parts of a role.

    Args:
        name: Whose the certificate is, ``cell/3`` or ``cell``.

    Raises:
        InvalidValueError: There is no such role.
    """
    return f"{name}/*" if role_of(name) in MANY and "/" not in name else name


def access_list(names: Mapping[str, str] = EVERY_ROLE) -> dict[str, object]:
    """Return Zenoh's ``access_control``: `RIGHTS`, and nothing else.

    A flow is seen from the hub: what comes in was sent or asked for by the part, what
    goes out is what the part gets. A rule's key has to include the key in question.

    Args:
        names: Whose each certificate is, by its common name; no other is accepted.
    """
    rules: list[dict[str, object]] = []
    policies: list[dict[str, object]] = []
    for common_name, name in names.items():
        own = list(_rules(common_name, parts_of(name)))
        rules += own
        ids = [rule["id"] for rule in own]
        policies.append({"rules": ids, "subjects": [common_name]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "cert_common_names": [name]} for name in names],
        "policies": policies,
    }


def _rules(common_name: str, who: str) -> Iterator[dict[str, object]]:
    """Yield the rules for a certificate that speaks for `who`."""
    rights = RIGHTS[role_of(who)]
    if rights.passes:
        yield {
            "id": common_name,
            "permission": "allow",
            "messages": list(MESSAGES),
            "flows": ["ingress", "egress"],
            "key_exprs": [f"{_EVERY}**"],
        }
        return
    publishes = tuple(wire.said_by(who, topic) for topic in rights.publishes)
    reads = _read_by(who, rights)
    alive = (f"alive/{who}",) if rights.announces else ()
    places = (f"{PLACE}/{who}/*/*",) if rights.announces else ()
    everybody = ("alive/**", f"{PLACE}/**") if rights.watches else ()
    answers = (DESCRIPTION,) if rights.briefs else ()
    asks = (DESCRIPTION,) if rights.asks else ()
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
                "id": f"{common_name} {message} {flow}",
                "permission": "allow",
                "messages": [message],
                "flows": [flow],
                "key_exprs": [_EVERY + key for key in keys],
            }


def _read_by(who: str, rights: Rights) -> tuple[str, ...]:
    """Return the key expressions of what a part may listen to."""
    kind, _, number = who.partition("/")
    if kind == "cell":
        return wire.cell_keys(number)
    if kind == "worker":
        return (*wire.worker_keys(number), *wire.LEARNING_KEYS)
    if rights.reads == ALL:
        return ("**",)
    return tuple(f"{topic}/**" for topic in rights.reads)
