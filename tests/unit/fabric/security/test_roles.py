"""The access list says what the table says, and the table what the wire needs."""

from collections.abc import Iterator, Mapping

import pytest
import zenoh

from neurosnap import wire
from neurosnap.fabric.security.roles import (
    DESCRIPTION,
    FLUSHED,
    PLACE,
    READING,
    RIGHTS,
    ROLES,
    access_list,
    role_of,
)

PREFIX = f"{wire.ROOT}/5eed/"

KEYS = {
    "observation": "observation",
    "wiring": "wiring/3",
    "wavestart": "wavestart",
    "pulse": "pulse/3/{}",
    "cellreport": "cellreport/{}",
    "state": "state",
    "reached": "reached",
    "decision": "decision",
    "keyframe": "keyframe",
    "fault": "fault/{}",
    "leave": "leave/{}",
    "workerwiring": "workerwiring/3",
    "pulsebatch": "pulsebatch/3/{}",
    "workerreport": "workerreport/{}",
    "anomaly": "anomaly",
    "recall": "recall",
    "recalled": "recalled/{}",
    "image": "image",
    "reminder": "reminder/cell/3",
    "band": "band/{}",
    "learn": "learn",
    "learned": "learned/{}",
}
"""A key of every topic, with room for who says it."""
TO_WORKERS = {"reminder": "reminder/worker/3"}
"""Where the key names the role that is told."""

PARTS = ("hub", "coordinator", "world", "recorder", "cell/3", "worker/3", "watcher")
"""A part of every role that shows who it is; `sensor` has none."""
MANY = ("cell", "worker")
NAMES = {name: name for name in (*PARTS, "cell/4", "worker/4", "sensor")}
"""A certificate a part."""

SPEAKERS = tuple(role for role in ROLES if role != "hub")
"""All roles but the one that passes on what all others say."""

SAID = {
    "coordinator": "anomaly band decision fault keyframe learn leave reached"
    " recall reminder state wavestart wiring workerwiring",
    "world": "fault image leave observation",
    "recorder": "fault",
    "cell": "cellreport fault leave pulse recalled",
    "worker": "band fault learned leave pulsebatch recalled workerreport",
    "watcher": "",
    "sensor": READING,
}
"""What each role may publish, written by hand: a slip in the table shows here."""

HEARD = {
    "coordinator": "cellreport fault learned leave observation recalled workerreport",
    "world": f"decision {READING} state",
    "recorder": " ".join(sorted(KEYS)),
    "cell": "observation pulse recall reminder wavestart wiring",
    "worker": "band learn observation pulsebatch recall reminder wavestart workerwiring",
    "watcher": " ".join(sorted(KEYS)),
    "sensor": "",
}
"""What each role may read, written by hand."""

MESSAGES = (
    *("put", "delete", "declare_subscriber", "query", "declare_queryable", "reply"),
    *("liveliness_token", "declare_liveliness_subscriber", "liveliness_query"),
)


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
    name: str,
    message: str,
    flow: str,
    key: str,
    names: Mapping[str, str] | None = None,
) -> bool:
    """Decide as the hub does: a rule's key must include the one in question."""
    return any(
        (what, way) == (message, flow)
        and zenoh.KeyExpr(expression).includes(zenoh.KeyExpr(PREFIX + key))
        for what, way, expression in granted(name, names)
    )


def test_every_topic_has_a_key_here() -> None:
    assert KEYS.keys() == wire.TOPICS.keys()


def test_who_may_say_and_hear_what_is_what_was_decided() -> None:
    said = {role: " ".join(sorted(RIGHTS[role].publishes)) for role in SPEAKERS}
    assert said == SAID
    heard = {role: " ".join(sorted(RIGHTS[role].reads)) for role in SPEAKERS}
    assert heard == HEARD
    flags = "announces", "passes", "watches", "briefs", "asks", "told"
    may = {role: [f for f in flags if getattr(RIGHTS[role], f)] for role in ROLES}
    assert may == {
        "hub": ["passes"],
        "coordinator": ["announces", "watches", "briefs"],
        "world": ["announces"],
        "recorder": ["announces", "watches"],
        "cell": ["announces"],
        "worker": ["announces"],
        "watcher": ["watches", "asks"],
        "sensor": ["told"],
    }


@pytest.mark.parametrize("role", SPEAKERS)
def test_a_role_may_do_what_was_decided_and_nothing_else(role: str) -> None:
    keys = KEYS | TO_WORKERS if role == "worker" else KEYS
    rules = [
        (message, flow, zenoh.KeyExpr(key)) for message, flow, key in granted(role)
    ]
    for topic in KEYS:
        wanted = set()
        if topic in SAID[role].split():
            wanted.add(("put", "ingress"))
        if topic in HEARD[role].split():
            wanted |= {("declare_subscriber", "ingress"), ("put", "egress")}
        several = {keys[topic].format(part_of(role))}
        if (role, topic) == ("worker", "band"):  # its own, and the coordinator's
            several.add(keys[topic].format("coordinator"))
        found = {
            (message, flow)
            for key in several
            for message, flow, rule in rules
            if rule.includes(zenoh.KeyExpr(PREFIX + key))
        }
        assert found == wanted, topic


def part_of(role: str) -> str:
    return f"{role}/3" if role in MANY else role


def speakers(topic: str, names: Mapping[str, str] | None) -> set[tuple[str, str]]:
    """Return who may say what as whom: (whose certificate, the sender in the key)."""
    return {
        (name, who)
        for name in (names or ROLES)
        if role_of(name) != "hub"  # passes on what any of them said
        for who in (*PARTS, "cell/4", "worker/4", "**", "cell/*", "worker/*")
        if allows(name, "put", "ingress", KEYS[topic].format(who), names)
    }


@pytest.mark.parametrize("topic", [topic for topic in KEYS if "{}" in KEYS[topic]])
def test_a_part_speaks_for_itself_alone(topic: str) -> None:
    found = speakers(topic, NAMES)
    assert found == {
        (name, name) for name in NAMES if topic in SAID.get(role_of(name), "").split()
    }
    assert found


@pytest.mark.parametrize("topic", [topic for topic in KEYS if "{}" in KEYS[topic]])
def test_a_role_speaks_for_its_parts_and_for_nobody_of_another_role(topic: str) -> None:
    found = speakers(topic, None)
    assert {role_of(who) == name for name, who in found} == {True}
    for role in MANY:
        if topic in SAID[role].split():
            assert {(role, f"{role}/3"), (role, f"{role}/4")} <= found


@pytest.mark.parametrize(
    ("mine", "others"), [("cell/3", "cell/4"), ("worker/3", "worker/4")]
)
def test_a_part_hears_what_is_for_it_alone(mine: str, others: str) -> None:
    heard = {"cell": wire.cell_keys, "worker": wire.worker_keys}[role_of(mine)]
    for key in heard(3):
        assert allows(mine, "declare_subscriber", "ingress", key, NAMES)
    for key in set(heard(4)) - set(heard(3)):
        assert allows(others, "declare_subscriber", "ingress", key, NAMES)
        assert not allows(mine, "declare_subscriber", "ingress", key, NAMES)
        assert not allows(mine, "put", "egress", key.replace("**", "cell/9"), NAMES)


def test_a_part_shows_as_itself_alone() -> None:
    for name in NAMES.keys() - {"hub"}:
        shown = {
            who
            for who in PARTS
            if allows(name, "liveliness_token", "ingress", f"alive/{who}", NAMES)
        }
        assert shown == ({name} if RIGHTS[role_of(name)].announces else set()) & {
            *PARTS
        }


@pytest.mark.parametrize("role", SPEAKERS)
def test_only_who_reads_everything_may_subscribe_to_everything(role: str) -> None:
    everything = role in ("recorder", "watcher")
    assert allows(role, "declare_subscriber", "ingress", "**") == everything


@pytest.mark.parametrize("role", SPEAKERS)
def test_a_role_shows_as_alive_under_its_own_names_alone(role: str) -> None:
    for who in PARTS:
        for key in (f"alive/{who}", f"{PLACE}/{who}/oak.lan/4711"):
            may = allows(role, "liveliness_token", "ingress", key)
            silent = ("watcher", "sensor")
            assert may == (who == part_of(role) and role not in silent), key


@pytest.mark.parametrize("role", SPEAKERS)
def test_presence_is_for_those_who_need_it(role: str) -> None:
    watches = role in ("coordinator", "recorder", "watcher")
    for below in ("alive", PLACE):
        asks = allows(role, "declare_liveliness_subscriber", "ingress", f"{below}/**")
        gets = allows(role, "liveliness_token", "egress", f"{below}/cell/3")
        assert (asks, gets) == (watches, watches)
    assert allows(role, "liveliness_query", "ingress", "alive/**") == watches


@pytest.mark.parametrize("role", SPEAKERS)
def test_everybody_may_ask_the_hub_whether_it_has_taken_everything(role: str) -> None:
    assert allows(role, "query", "ingress", FLUSHED)
    assert not allows(role, "query", "ingress", "**")


def test_a_hub_passes_on_all_that_any_part_may_say_or_hear_and_no_more() -> None:
    passed = set(granted("hub"))
    every = {
        (message, flow)
        for role in SPEAKERS
        for message, flow, _ in granted(role)
        # What comes in at one hub goes out at another, and the other way round.
        for flow in ("ingress", "egress")
    }
    assert passed == {(*what, f"{wire.ROOT}/*/**") for what in every}
    assert not any(message == "delete" for message, _, _ in passed)


def test_cells_and_workers_may_listen_to_what_they_listen_to() -> None:
    for key in wire.cell_keys(3):
        assert allows("cell", "declare_subscriber", "ingress", key)
    for key in wire.worker_keys(3):
        assert allows("worker", "declare_subscriber", "ingress", key)


def test_what_is_outside_the_swarms_prefix_is_nobodys() -> None:
    for role in ROLES:
        for _, _, expression in granted(role):
            assert expression.startswith("neurosnap/*/")


@pytest.mark.parametrize(
    ("who", "role"), [("cell/17", "cell"), ("world", "world"), ("worker/a", "worker")]
)
def test_a_parts_role_is_the_first_word_of_its_name(who: str, role: str) -> None:
    assert role_of(who) == role


READINGS = (READING, f"{READING}/door", f"{READING}/kitchen/door")


@pytest.mark.parametrize("role", SPEAKERS)
@pytest.mark.parametrize("key", READINGS)
def test_sensors_put_readings_and_the_world_gets_them(role: str, key: str) -> None:
    wanted = {
        "sensor": {("put", "ingress"), ("declare_subscriber", "egress")},
        "world": {("declare_subscriber", "ingress"), ("put", "egress")},
    }
    if role in ("recorder", "watcher"):
        wanted[role] = wanted["world"]
    found = {
        (message, flow)
        for message in MESSAGES
        for flow in ("ingress", "egress")
        if allows(role, message, flow, key)
    }
    assert found == wanted.get(role, set())


def test_a_sensor_is_told_of_who_listens_to_readings_and_to_nothing_else() -> None:
    assert allows("sensor", "declare_subscriber", "egress", f"{READING}/**")
    assert not allows("sensor", "declare_subscriber", "egress", "**")
    assert not any(
        allows("sensor", "declare_subscriber", flow, key)
        for flow in ("ingress", "egress")
        for key in KEYS.values()
        if "{}" not in key
    )


def test_what_is_no_message_of_ours_has_keys_of_its_own() -> None:
    assert {READING, PLACE, DESCRIPTION, FLUSHED, "alive"}.isdisjoint(wire.TOPICS)


@pytest.mark.parametrize("role", SPEAKERS)
def test_one_role_tells_what_the_run_is_and_one_may_ask(role: str) -> None:
    tells, asks = role == "coordinator", role == "watcher"
    for message, flow in (
        ("declare_queryable", "ingress"),
        ("query", "egress"),
        ("reply", "ingress"),
    ):
        assert allows(role, message, flow, DESCRIPTION) == tells
        assert not allows(role, message, flow, "**")
    assert allows(role, "query", "ingress", DESCRIPTION) == asks
    assert allows(role, "reply", "egress", DESCRIPTION) == asks
