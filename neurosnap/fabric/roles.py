"""Permissions per role: the keys a part may publish or subscribe to.

Whatever the table does not allow is denied, to known names and to strangers. A name is
the common name of a certificate, so the list means something under mutual TLS only. It
is a role's, ``cell``, which can speak for any cell, and for no part of another role.
"""

from collections.abc import Iterator
from typing import Literal, NamedTuple, TypeAlias, get_args

from neurosnap import wire
from neurosnap.errors import InvalidValueError

Role: TypeAlias = Literal[
    "hub", "coordinator", "world", "recorder", "cell", "worker", "watcher", "sensor"
]
ROLES: tuple[Role, ...] = get_args(Role)
READING = "reading"
"""Where programs outside put what their sensors read: no message of ours."""


class Rights(NamedTuple):
    """The permissions of one role."""

    publishes: tuple[str, ...] = ()
    """Topics it may send to."""
    reads: tuple[str, ...] = ()
    """Key expressions it may listen to."""
    announces: bool = False
    """It may show itself as alive."""
    passes: bool = False
    """It passes on whatever the others say and hear, either way, and says what others
    said."""
    watches: bool = False
    """It may follow who is alive."""
    briefs: bool = False
    """It answers what the run is."""
    asks: bool = False
    """It may ask that."""
    told: bool = False
    """It is told who listens to what it publishes: a stock client's declared publisher
    sends nothing as long as it knows of no listener. Ours do not ask."""


_ALL = ("**",)

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
        reads=wire.COORDINATOR_KEYS,
        announces=True,
        watches=True,
        briefs=True,
    ),
    "world": Rights(
        publishes=("observation", "image", "fault", "leave"),
        reads=("state", "decision", f"{READING}/**"),
        announces=True,
    ),
    "recorder": Rights(("fault", "leave"), _ALL, announces=True, watches=True),
    "cell": Rights(
        publishes=("pulse", "cellreport", "recalled", "fault", "leave"),
        reads=wire.cell_keys("*"),
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
        reads=wire.worker_keys("*"),
        announces=True,
    ),
    # Looks on, and leaves no trace.
    "watcher": Rights(reads=_ALL, watches=True, asks=True),
    # Any program that knows something, and nothing of ours.
    "sensor": Rights(publishes=(READING,), told=True),
}

DESCRIPTION = "brief"
"""What a coordinator answers to those who want to take part in its run."""
FLUSHED = "flushed"
"""What every part asks for at its end; the hub itself answers that no part has it."""

MESSAGES = (
    *("put", "declare_subscriber", "query", "declare_queryable", "reply"),
    *("liveliness_token", "declare_liveliness_subscriber", "liveliness_query"),
)
"""What parts send, as Zenoh's rules call it: nothing is ever deleted."""

_EVERY = f"{wire.ROOT}/*/"  # below any swarm's prefix
_MANY = ("cell", "worker")
"""Roles of which there are many parts."""


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

    A flow is seen from the hub: what comes in was sent or asked for by the part, what
    goes out is what the part gets. A rule's key has to include the key in question.
    """
    rules: list[dict[str, object]] = []
    policies: list[dict[str, object]] = []
    for role in ROLES:
        own = list(_rules(role))
        rules += own
        policies.append({"rules": [rule["id"] for rule in own], "subjects": [role]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": role, "cert_common_names": [role]} for role in ROLES],
        "policies": policies,
    }


def _rules(role: Role) -> Iterator[dict[str, object]]:
    """Yield the rules for the certificate of a role."""
    rights = RIGHTS[role]
    who = f"{role}/*" if role in _MANY else role
    if rights.passes:
        yield {
            "id": role,
            "permission": "allow",
            "messages": list(MESSAGES),
            "flows": ["ingress", "egress"],
            "key_exprs": [f"{_EVERY}**"],
        }
        return
    publishes = tuple(wire.said_by(who, topic) for topic in rights.publishes)
    alive = (f"alive/{who}/*",) if rights.announces else ()
    everybody = ("alive/**",) if rights.watches else ()
    answers = (DESCRIPTION,) if rights.briefs else ()
    asks = (DESCRIPTION,) if rights.asks else ()
    for message, flow, keys in (
        ("put", "ingress", publishes),
        ("declare_subscriber", "egress", publishes if rights.told else ()),
        ("declare_subscriber", "ingress", rights.reads),
        ("put", "egress", rights.reads),
        ("liveliness_token", "ingress", alive),
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
