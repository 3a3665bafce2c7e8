"""The access list says what the table says, and the table what the wire needs."""

from collections.abc import Iterator

import pytest
import zenoh

from neurosnap import wire
from neurosnap.fabric.access import (
    ALL,
    BRIEF,
    FLUSHED,
    PLACE,
    READING,
    RIGHTS,
    ROLES,
    Rights,
    access_list,
    role_of,
)

PREFIX = f"{wire.ROOT}/5eed/"

KEYS = {
    "observe": "observe",
    "wiring": "wiring/3",
    "wave": "wave/3",
    "excite": "excite/3",
    "inhibit": "inhibit/3",
    "settle": "settle",
    "state": "state",
    "reach": "reach",
    "decide": "decide",
    "keyframe": "keyframe",
    "fault": "fault",
    "leave": "leave",
    "loom": "loom/3",
    "burst": "burst/3",
    "tally": "tally",
    "anomaly": "anomaly",
}
"""A key of every topic."""

MESSAGES = (
    *("put", "delete", "declare_subscriber", "query", "declare_queryable", "reply"),
    *("liveliness_token", "declare_liveliness_subscriber", "liveliness_query"),
)


def granted(role: str) -> Iterator[tuple[str, str, str]]:
    """Yield (message, flow, key expression) of what the list allows a role."""
    rights = access_list()
    assert rights["enabled"] is True
    assert rights["default_permission"] == "deny"
    subjects, policies, rules = (
        rights[what] for what in ("subjects", "policies", "rules")
    )
    assert isinstance(subjects, list)
    assert isinstance(policies, list)
    assert isinstance(rules, list)
    (subject,) = [s["id"] for s in subjects if s["cert_common_names"] == [role]]
    by_id = {rule["id"]: rule for rule in rules}
    assert len(by_id) == len(rules)
    for policy in policies:
        if subject in policy["subjects"]:
            for name in policy["rules"]:
                rule = by_id[name]
                assert rule["permission"] == "allow"
                for message in rule["messages"]:
                    for flow in rule["flows"]:
                        for key in rule["key_exprs"]:
                            yield message, flow, key


def allows(role: str, message: str, flow: str, key: str) -> bool:
    """Decide as the hub does: a rule's key must include the one in question."""
    return any(
        (what, way) == (message, flow)
        and zenoh.KeyExpr(expression).includes(zenoh.KeyExpr(PREFIX + key))
        for what, way, expression in granted(role)
    )


def test_every_topic_has_a_key_here() -> None:
    assert KEYS.keys() == wire.TOPICS.keys()


def test_every_role_has_its_rights() -> None:
    assert tuple(RIGHTS) == ROLES


@pytest.mark.parametrize("role", ROLES)
@pytest.mark.parametrize("topic", KEYS)
def test_a_role_may_do_what_the_table_says_and_nothing_else(
    role: str, topic: str
) -> None:
    rights: Rights = RIGHTS[role]  # type: ignore[index]
    wanted = set()
    if topic in rights.publishes:
        wanted.add(("put", "ingress"))
    if topic in rights.reads:
        wanted |= {("declare_subscriber", "ingress"), ("put", "egress")}
    found = {
        (message, flow)
        for message in MESSAGES
        for flow in ("ingress", "egress")
        if allows(role, message, flow, KEYS[topic])
    }
    assert found == wanted


@pytest.mark.parametrize("role", ROLES)
def test_only_who_reads_everything_may_subscribe_to_everything(role: str) -> None:
    reads = RIGHTS[role].reads  # type: ignore[index]
    assert allows(role, "declare_subscriber", "ingress", "**") == (reads == ALL)


@pytest.mark.parametrize("role", ROLES)
@pytest.mark.parametrize(
    "who", ["coordinator", "world", "recorder", "cell/3", "worker/3", "watcher", "hub"]
)
def test_a_role_shows_as_alive_under_its_own_names_alone(role: str, who: str) -> None:
    own = {
        "coordinator": {"coordinator"},
        "world": {"world"},
        "recorder": {"recorder"},
        "cell": {"cell/3"},
        "worker": {"worker/3"},
    }
    for key in (f"alive/{who}", f"{PLACE}/{who}/oak.lan/4711"):
        may = allows(role, "liveliness_token", "ingress", key)
        assert may == (who in own.get(role, set()))


@pytest.mark.parametrize("role", ROLES)
def test_presence_is_for_those_who_need_it(role: str) -> None:
    watches = role in ("coordinator", "recorder", "watcher")
    for below in ("alive", PLACE):
        asks = allows(role, "declare_liveliness_subscriber", "ingress", f"{below}/**")
        gets = allows(role, "liveliness_token", "egress", f"{below}/cell/3")
        assert (asks, gets) == (watches, watches)


@pytest.mark.parametrize("role", ROLES)
def test_everybody_may_ask_the_hub_whether_it_has_taken_everything(role: str) -> None:
    assert allows(role, "query", "ingress", FLUSHED)
    assert not allows(role, "query", "ingress", "**")


def test_cells_and_workers_may_listen_to_what_they_listen_to() -> None:
    for key in wire.cell_keys(3):
        assert allows("cell", "declare_subscriber", "ingress", key)
    for key in wire.worker_keys(3):
        assert allows("worker", "declare_subscriber", "ingress", key)


def test_every_topic_is_somebodys_to_publish_and_somebodys_to_read() -> None:
    parts = [rights for role, rights in RIGHTS.items() if role != "hub"]
    known = {*KEYS, READING}
    assert {topic for rights in parts for topic in rights.publishes} == known
    assert {topic for rights in parts for topic in rights.reads} == known


@pytest.mark.parametrize("topic", ["wiring", "loom", "wave", "state", "decide"])
def test_only_the_coordinator_conducts(topic: str) -> None:
    may = {role for role, rights in RIGHTS.items() if topic in rights.publishes}
    assert may == {"hub", "coordinator"}


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


@pytest.mark.parametrize("role", ROLES)
@pytest.mark.parametrize("key", READINGS)
def test_sensors_put_readings_and_the_world_gets_them(role: str, key: str) -> None:
    wanted = {
        "sensor": {("put", "ingress"), ("declare_subscriber", "egress")},
        "world": {("declare_subscriber", "ingress"), ("put", "egress")},
    }
    if RIGHTS[role].reads == ALL:  # type: ignore[index]
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
    )


def test_what_is_no_message_of_ours_has_keys_of_its_own() -> None:
    assert {READING, PLACE, BRIEF, FLUSHED, "alive"}.isdisjoint(wire.TOPICS)


@pytest.mark.parametrize("role", ROLES)
def test_one_role_tells_what_the_run_is_and_one_may_ask(role: str) -> None:
    tells, asks = role == "coordinator", role == "watcher"
    for message, flow in (
        ("declare_queryable", "ingress"),
        ("query", "egress"),
        ("reply", "ingress"),
    ):
        assert allows(role, message, flow, BRIEF) == tells
        assert not allows(role, message, flow, "**")
    assert allows(role, "query", "ingress", BRIEF) == asks
    assert allows(role, "reply", "egress", BRIEF) == asks


@pytest.mark.parametrize("role", ROLES)
def test_who_is_there_may_be_asked_by_those_who_watch(role: str) -> None:
    watches = role in ("coordinator", "recorder", "watcher")
    assert allows(role, "liveliness_query", "ingress", "alive/**") == watches
