"""The access list is the one written here by hand, and it holds parts to their own."""

from collections.abc import Iterator, Mapping

import pytest
import zenoh

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.fabric.security.roles import (
    DESCRIPTION,
    FLUSHED,
    PLACE,
    READING,
    ROLES,
    access_list,
    parts_of,
    role_of,
)

PREFIX = f"{wire.ROOT}/5eed/"
SPEAKERS = tuple(role for role in ROLES if role != "hub")
"""All roles but the one that passes on what all others say."""

# What each certificate may do, in the words of Zenoh: `>` comes in at the hub, `<` goes
# out. Written by hand: a slip in the table of the code shows here.
_READS = "put<", "declare_subscriber>"
_WATCHES = {
    "alive/** place/**": (
        "declare_liveliness_subscriber>",
        "liveliness_query>",
        "liveliness_token<",
    )
}
_CELL_READS = (
    "observation wavestart recall wiring/{n} wavestart/{n} recall/{n} reminder/cell/{n}"
    " pulse/{n}/**"
)
_WORKER_READS = (
    "observation workerwiring/{n} reminder/worker/{n} wavestart recall"
    " pulsebatch/{n}/** learn band/coordinator"
)


def _cell(n: str) -> dict[str, tuple[str, ...]]:
    return {
        f"pulse/*/cell/{n} cellreport/cell/{n} recalled/cell/{n} fault/cell/{n}"
        f" leave/cell/{n}": ("put>",),
        _CELL_READS.format(n=n): _READS,
        f"alive/cell/{n} place/cell/{n}/*/*": ("liveliness_token>",),
        "flushed": ("query>",),
    }


def _worker(n: str) -> dict[str, tuple[str, ...]]:
    return {
        f"pulsebatch/*/worker/{n} workerreport/worker/{n} recalled/worker/{n} learned"
        f"/worker/{n} band/worker/{n} fault/worker/{n} leave/worker/{n}": ("put>",),
        _WORKER_READS.format(n=n): _READS,
        f"alive/worker/{n} place/worker/{n}/*/*": ("liveliness_token>",),
        "flushed": ("query>",),
    }


MAY: dict[str, dict[str, tuple[str, ...]]] = {
    "coordinator": {
        "wiring/** workerwiring/** wavestart/** state/** reached/** decision/**"
        " recall/** reminder/** keyframe/** band/coordinator learn/** anomaly/**"
        " fault/coordinator leave/coordinator": ("put>",),
        "observation/** cellreport/** workerreport/** recalled/** learned/** fault/**"
        " leave/**": _READS,
        "alive/coordinator place/coordinator/*/*": ("liveliness_token>",),
        "brief": ("declare_queryable>", "query<", "reply>"),
        "flushed": ("query>",),
        **_WATCHES,
    },
    "world": {
        "observation/** image/** fault/world leave/world": ("put>",),
        "state/** decision/** reading/**": _READS,
        "alive/world place/world/*/*": ("liveliness_token>",),
        "flushed": ("query>",),
    },
    "recorder": {
        "fault/recorder": ("put>",),
        "**": _READS,
        "alive/recorder place/recorder/*/*": ("liveliness_token>",),
        "flushed": ("query>",),
        **_WATCHES,
    },
    "cell": _cell("*"),
    "cell/3": _cell("3"),
    "worker": _worker("*"),
    "worker/3": _worker("3"),
    # Leaves no trace.
    "watcher": {"**": _READS, "brief": ("reply<",), "flushed brief": ("query>",)}
    | _WATCHES,
    # Is told of who listens to readings, and to nothing else.
    "sensor": {"reading/**": ("put>", "declare_subscriber<"), "flushed": ("query>",)},
}
ALL = (
    *("put", "declare_subscriber", "query", "declare_queryable", "reply"),
    *("liveliness_token", "declare_liveliness_subscriber", "liveliness_query"),
)
"""What a hub passes on, either way; nothing is ever deleted."""


def granted(
    name: str, names: Mapping[str, str] | None = None
) -> Iterator[tuple[str, str, str]]:
    """Yield (message, flow, key expression) of what the list allows a certificate."""
    rights = access_list() if names is None else access_list(names)
    assert rights["enabled"] is True
    assert rights["default_permission"] == "deny"
    subjects, policies, rules = (
        rights[what] for what in ("subjects", "policies", "rules")
    )
    assert isinstance(subjects, list)
    assert isinstance(policies, list)
    assert isinstance(rules, list)
    (subject,) = [s["id"] for s in subjects if s["cert_common_names"] == [name]]
    by_id = {rule["id"]: rule for rule in rules}
    assert len(by_id) == len(rules)
    for policy in policies:
        if subject in policy["subjects"]:
            for rule_id in policy["rules"]:
                rule = by_id[rule_id]
                assert rule["permission"] == "allow"
                for message in rule["messages"]:
                    for flow in rule["flows"]:
                        for key in rule["key_exprs"]:
                            yield message, flow, key


def allows(
    name: str, message: str, flow: str, key: str, names: Mapping[str, str] | None = None
) -> bool:
    """Decide as the hub does: a rule's key must include the one in question."""
    return any(
        (what, way) == (message, flow)
        and zenoh.KeyExpr(expression).includes(zenoh.KeyExpr(PREFIX + key))
        for what, way, expression in granted(name, names)
    )


@pytest.mark.parametrize("name", MAY)
def test_a_certificate_may_do_what_is_written_here_and_nothing_else(name: str) -> None:
    wanted = {
        (what[:-1], "ingress" if what[-1] == ">" else "egress", f"neurosnap/*/{key}")
        for keys, several in MAY[name].items()
        for key in keys.split()
        for what in several
    }
    assert set(granted(name, {name: name})) == wanted


def test_every_role_is_written_here_and_a_hub_passes_on_all_they_may_say() -> None:
    assert {role_of(name) for name in MAY} == set(SPEAKERS)
    passed = {
        (m, flow, "neurosnap/*/**") for m in ALL for flow in ("ingress", "egress")
    }
    assert set(granted("hub")) == passed
    assert {message for name in MAY for message, _, _ in granted(role_of(name))} == {
        *ALL
    }


NAMES = {name: name for name in (*SPEAKERS, "cell/3", "cell/4", "worker/3", "worker/4")}


@pytest.mark.parametrize(
    "key", ["pulse/3/{}", "pulsebatch/3/{}", "recalled/{}", "fault/{}", "leave/{}"]
)
def test_nobody_speaks_for_another(key: str) -> None:
    said = {
        (name, who)
        for name in NAMES
        for who in ("hub", *NAMES, "**", "cell/*", "worker/*")
        if allows(name, "put", "ingress", key.format(who), NAMES)
    }
    assert said
    for name, who in said:
        assert who in (name, parts_of(name)) or who.startswith(f"{name}/")


@pytest.mark.parametrize(
    ("mine", "keys"), [("cell/3", wire.cell_keys), ("worker/3", wire.worker_keys)]
)
def test_a_part_hears_what_is_for_it_alone(mine: str, keys: object) -> None:
    assert callable(keys)
    for key in keys(3):
        assert allows(mine, "declare_subscriber", "ingress", key, NAMES)
        assert allows(role_of(mine), "declare_subscriber", "ingress", key, NAMES)
    for key in set(keys(4)) - set(keys(3)):
        assert not allows(mine, "declare_subscriber", "ingress", key, NAMES)
        assert not allows(mine, "put", "egress", key.replace("**", "cell/9"), NAMES)


def test_what_is_no_message_of_ours_has_keys_that_none_of_ours_has() -> None:
    assert {READING, PLACE, DESCRIPTION, FLUSHED, "alive"}.isdisjoint(wire.TOPICS)


def test_a_parts_role_is_the_first_word_of_its_name() -> None:
    assert [role_of(who) for who in ("cell/17", "world", "worker/a")] == [
        *("cell", "world", "worker")
    ]
    with pytest.raises(InvalidValueError, match=r"^part: must be of hub, coordinator"):
        role_of("outlet")
