"""The access list equals a hand-written one, and limits each part to its own keys."""

from collections.abc import Iterator

import pytest

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.fabric.roles import (
    DESCRIPTION,
    FLUSHED,
    READING,
    ROLES,
    access_list,
    role_of,
)

SPEAKERS = tuple(role for role in ROLES if role != "hub")
"""All roles but the one that passes on what all others say."""

# What each certificate may do, in the words of Zenoh: `>` comes in at the hub, `<` goes
# out. Written by hand: a slip in the table of the code shows here.
_READS = "put<", "declare_subscriber>"
_WATCHES = {
    "alive/**": (
        "declare_liveliness_subscriber>",
        "liveliness_query>",
        "liveliness_token<",
    )
}
MAY: dict[str, dict[str, tuple[str, ...]]] = {
    "coordinator": {
        "wiring/** workerwiring/** wavestart/** state/** reached/** decision/**"
        " recall/** reminder/** keyframe/** band/coordinator learn/** anomaly/**"
        " fault/coordinator leave/coordinator": ("put>",),
        "observation cellreport/** workerreport/** recalled/** learned/** fault/**"
        " leave/**": _READS,
        "alive/coordinator/*": ("liveliness_token>",),
        "brief": ("declare_queryable>", "query<", "reply>"),
        "flushed": ("query>",),
        **_WATCHES,
    },
    "world": {
        "observation/** image/** fault/world leave/world": ("put>",),
        "state decision reading/**": _READS,
        "alive/world/*": ("liveliness_token>",),
        "flushed": ("query>",),
    },
    "recorder": {
        "fault/recorder leave/recorder": ("put>",),
        "**": _READS,
        "alive/recorder/*": ("liveliness_token>",),
        "flushed": ("query>",),
        **_WATCHES,
    },
    "cell": {
        "pulse/*/cell/* cellreport/cell/* recalled/cell/* fault/cell/* leave/cell/*": (
            "put>",
        ),
        "observation wavestart recall wiring/* wavestart/* recall/* reminder/cell/*"
        " pulse/*/**": _READS,
        "alive/cell/*/*": ("liveliness_token>",),
        "flushed": ("query>",),
    },
    "worker": {
        "pulsebatch/*/worker/* workerreport/worker/* recalled/worker/* learned/worker/*"
        " band/worker/* fault/worker/* leave/worker/*": ("put>",),
        "workerwiring/* reminder/worker/* wavestart recall pulsebatch/*/**"
        " learn band/coordinator": _READS,
        "alive/worker/*/*": ("liveliness_token>",),
        "flushed": ("query>",),
    },
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


def granted(name: str) -> Iterator[tuple[str, str, str]]:
    """Yield (message, flow, key expression) of what the list allows a certificate."""
    rights = access_list()
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


@pytest.mark.parametrize("name", MAY)
def test_a_certificate_may_do_what_is_written_here_and_nothing_else(name: str) -> None:
    wanted = {
        (what[:-1], "ingress" if what[-1] == ">" else "egress", f"neurosnap/*/{key}")
        for keys, several in MAY[name].items()
        for key in keys.split()
        for what in several
    }
    assert set(granted(name)) == wanted


def test_every_role_is_written_here_and_a_hub_passes_on_all_they_may_say() -> None:
    assert set(MAY) == set(SPEAKERS)
    passed = {
        (m, flow, "neurosnap/*/**") for m in ALL for flow in ("ingress", "egress")
    }
    assert set(granted("hub")) == passed
    assert {message for name in MAY for message, _, _ in granted(name)} == {*ALL}


def test_what_is_no_message_of_ours_has_keys_that_none_of_ours_has() -> None:
    assert {READING, DESCRIPTION, FLUSHED, "alive"}.isdisjoint(wire.TOPICS)


def test_a_parts_role_is_the_first_word_of_its_name() -> None:
    assert [role_of(who) for who in ("cell/17", "world", "worker/a")] == [
        *("cell", "world", "worker")
    ]
    with pytest.raises(InvalidValueError, match=r"^part: must be of hub, coordinator"):
        role_of("outlet")
