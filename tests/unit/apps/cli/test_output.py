"""What people are told fits on a screen, and names where the rest is."""

import io
from pathlib import Path

import msgspec
import pytest
from rich.console import Console

from neurosnap.agent.body import Body
from neurosnap.apps.cli import output
from neurosnap.protocol.anomaly_messages import Link, Told, anomaly_line
from neurosnap.protocol.coordinator import Totals
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.replay.verify import Verdict
from neurosnap.runtime.request import Outcome

OPTIONS = RunOptions(source="a.csv", body=Body(own=("a", "b")), cells="inline")
OUTCOME = Outcome(
    totals=Totals(ticks=6),
    implications=[],
    completeness=None,
    seconds=1.0,
    startup=0.0,
    stopped=False,
)
VERDICT = Verdict(
    files=1,
    same=True,
    complete=True,
    difference=None,
    start=0,
    ticks=89,
    wirings=3,
    waves=178,
    states=89,
    decisions=89,
    seconds=0.5,
)


def told(
    outcome: Outcome = OUTCOME, log: Path | None = None, **changes: object
) -> list[str]:
    """Return the lines that a run ends with."""
    text = io.StringIO()
    changed = msgspec.structs.replace(outcome, **changes)
    output.outcome(Console(file=text, width=100), OPTIONS, changed, log)
    return text.getvalue().splitlines()


def many(name: str, count: int) -> tuple[str, ...]:
    return tuple(f"{name}{number}" for number in range(count))


def test_an_anomaly_names_a_few_sensors_and_how_many_more_there_are() -> None:
    links = tuple(Link(f"{name} -> x", 1, 0, 1) for name in many("s", 30))
    line = anomaly_line(
        Told(
            tick=7,
            since=7,
            culprits=many("guilty", 9),
            candidates=(*many("guilty", 9), *many("other", 8)),
            exact=True,
            broken=links,
            more=70,
        )
    )
    guilty, others = ", ".join(many("guilty", 8)), ", ".join(many("other", 8))
    assert f"tick 7: {guilty} and 1 more or {others} may be wrong: breaks s0" in line
    assert line.endswith("s2 -> x (1 for, 0 against, since tick 1) and 97 more")


def test_a_name_cannot_turn_the_text_around() -> None:
    name = "door\u202eno"  # as an older recording may have it, or a stranger's
    link = Link(f"{name} -> x", 1, 0, 1)
    one = Told(7, 7, (name,), (name,), True, (link,), 0)
    assert "\u202e" not in anomaly_line(one)
    assert "door\\u202eno may be wrong" in anomaly_line(one)
    shown = told(implications=[(name, "x")])
    assert "  door\\u202eno → x" in shown


def test_a_run_names_the_command_that_shows_all_it_learned() -> None:
    pairs = [(low, "top") for low in many("s", 26)]
    shown = told(implications=pairs, log=Path("my logs/a.mcap"))
    table = "with tests and failures: neurosnap learn 'my logs/a.mcap'"
    assert f"  and 2 more; {table}" in shown
    assert "  and 2 more; all: --format json" in told(implications=pairs)


def test_a_run_that_learned_nothing_names_no_command() -> None:
    shown = told(implications=[("a", "b")], log=Path("a.mcap"))
    assert "  a → b" in shown
    assert any("neurosnap learn a.mcap" in line for line in shown)
    nothing = told(implications=[], log=Path("a.mcap"))
    assert not any("learn" in line for line in nothing)


def test_messages_that_are_missing_are_counted() -> None:
    missing = dict.fromkeys(many("cell/", 300), 2)
    *_, last = told(completeness=Completeness(9, missing))
    parts = ", ".join(f"2 of cell/{number}" for number in range(8))
    assert last == f"the recording lacks 600 messages: {parts} and 292 more"


@pytest.mark.parametrize(
    ("decisions", "said"),
    [(89, "89 decisions, 3"), (90, "90 decisions, since a start makes one, too, 3")],
)
def test_a_decision_that_has_no_state_is_explained(decisions: int, said: str) -> None:
    text = io.StringIO()
    found = msgspec.structs.replace(VERDICT, decisions=decisions)
    output.verdict(Console(file=text, width=400), found)
    assert f"(89 states, {said} wirings, 178 waves; 0.50 s)" in text.getvalue()
