"""Printed text fits a screen and says where to find the rest."""

from pathlib import Path

import msgspec
import pytest
import typer

from neurosnap.agent.body import Body
from neurosnap.apps.cli.errors_and_signals import errors
from neurosnap.apps.cli.terminal_output import outcome_lines, restart_lines, say
from neurosnap.errors import NeurosnapError
from neurosnap.protocol.anomaly_report import NamedAnomaly, anomaly_line
from neurosnap.protocol.coordinator import Totals
from neurosnap.protocol.run_options import RunOptions
from neurosnap.protocol.tick_times import Behind
from neurosnap.recording.format.completeness import Completeness
from neurosnap.runtime.request import Outcome, Restart

OPTIONS = RunOptions(source="a.csv", body=Body(own=("a", "b")), cells="inline")
OUTCOME = Outcome(
    totals=Totals(ticks=6),
    implications=[],
    completeness=None,
    seconds=1.0,
    stopped=False,
)


def told(log: Path | None = None, **changes: object) -> list[str]:
    """Return the lines that a run ends with."""
    changed = msgspec.structs.replace(OUTCOME, **changes)
    return list(outcome_lines(OPTIONS, changed, log))


def many(name: str, count: int) -> tuple[str, ...]:
    return tuple(f"{name}{number}" for number in range(count))


def test_an_anomaly_names_a_few_sensors_and_how_many_more_there_are() -> None:
    culprits = many("guilty", 9)
    candidates = (*culprits, *many("other", 8))
    line = anomaly_line(NamedAnomaly(7, 7, culprits, candidates, False, (), 70, "so"))
    guilty, others = ", ".join(many("guilty", 8)), ", ".join(many("other", 8))
    wrong = f"{guilty} and 1 more or {others} (at least) may be wrong"
    assert line == f"tick 7: so; {wrong}"


def test_the_pace_is_that_of_the_ticks_that_were_made() -> None:
    assert "6 in 1.0 s (6 a second)" in "\n".join(told())
    gone_on = "\n".join(told(after=4, restarts=1))
    assert "6, 2 of them in 1.0 s (2 a second)" in gone_on


def test_a_run_that_fell_behind_says_when_by_how_much_and_for_whom() -> None:
    line = "at tick 4 most: 2.5 s behind, 7 ticks wait; the cells took 80% of the time"
    behind = Behind(4, 2.5, 7, "cells", 0.8)
    assert f"behind        {line}" in told(behind=behind)
    assert not any("behind" in each for each in told())


def test_a_name_cannot_turn_the_text_around() -> None:
    name = "door\u202eno"  # as an older recording may have it, or a stranger's
    sentence = f"{name} is on"
    line = anomaly_line(NamedAnomaly(7, 7, (name,), (name,), False, (), 0, sentence))
    assert "\u202e" not in line
    assert line.count("door\\u202eno") == 2
    assert "  door\\u202eno → x" in told(implications=[(name, "x")])


def test_a_run_names_the_command_that_shows_all_it_learned() -> None:
    pairs, log = [(low, "top") for low in many("s", 26)], Path("my logs/a.mcap")
    table = "with tests and failures: neurosnap learn 'my logs/a.mcap'"
    assert f"  and 2 more; {table}" in told(log, implications=pairs)
    assert f"  {table}" in told(log, implications=pairs[:1])
    assert "  and 2 more; all: --format json" in told(implications=pairs)
    assert not any("learn" in line for line in told(log, implications=[]))


def test_messages_that_are_missing_are_counted() -> None:
    missing = dict.fromkeys(many("cell/", 300), 2)
    *_, last = told(completeness=Completeness(9, missing))
    parts = ", ".join(f"2 of cell/{number}" for number in range(8))
    assert last == f"the recording lacks 600 messages: {parts} and 292 more"


@pytest.mark.parametrize(
    "text",
    [r"\[/b]", "[/red]", "[link=file:/x]", "\\", "a\\[x]\\", "[]", "a:cat:b"],
)
def test_what_is_said_is_not_taken_for_markup(
    text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(typer.Exit) as ended, errors():
        raise NeurosnapError(text)
    say("json", text)
    say("text", text)
    assert ended.value.exit_code == 1
    assert capsys.readouterr() == (f"{text}\n", f"error: {text}\n{text}\n")


def test_a_restart_says_why_each_recording_is_kept() -> None:
    kept = ((Path("a"), 0), (Path("b"), 7))
    assert list(restart_lines(Restart("hub: died", 9, 2, kept=kept))) == [
        "going on from tick 9: hub: died; 2 ticks are done again",
        "could not go on from a recording; kept: a",
        "went on from tick 7 of a recording, of which later ones cannot be read or were"
        " observed otherwise; kept: b",
    ]
