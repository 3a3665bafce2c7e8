"""The command line as people and scripts meet it: output, exit codes, signals."""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import msgspec
import psutil
import pytest

from neurosnap import wire
from neurosnap.apps.cli import app
from neurosnap.recording.read.reader import Recording
from neurosnap.recording.replay.verify import Verdict, verify
from neurosnap.recording.write.writer import Writer
from tests.support.command_line import call
from tests.support.commands import Command
from tests.support.patience import PATIENCE

pytestmark = pytest.mark.slow

VERBS = (
    "run",
    "replay",
    "depth",
    "figures",
    "info",
    "graph",
    "model",
    "doctor",
    "salvage",
    "export",
    "hub",
    "ps",
    "stop",
    "coordinate",
    "world",
    "record",
    "join",
    "watch",
    "view",
    "keys",
)
RUN_KEYS = {
    "log",
    "ticks",
    "cells",
    "waves",
    "pulses",
    "depth",
    "height",
    "incoherent",
    "seconds",
}


# Calling it ---------------------------------------------------------------------------


def last_json(stdout: str) -> dict[str, Any]:
    facts = json.loads(stdout.splitlines()[-1])
    assert isinstance(facts, dict)
    return facts


def happy(*arguments: object, stdin: str | None = None) -> dict[str, Any]:
    """Run a command that succeeds; return the JSON object it prints last."""
    result = call(*arguments, "--json", stdin=stdin)
    assert result.exit_code == 0, result.stderr
    return last_json(result.stdout)


def refused(*arguments: object) -> str:
    """Run a command that is used wrongly; return what it says of it, on one line."""
    result = call(*arguments)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    return flat(result.stderr)


def failed(*arguments: object) -> str:
    """Run a command that fails; return what it says of it, on one line."""
    result = call(*arguments)
    assert result.exit_code == 1, result.output
    return flat(result.stderr)


def flat(text: str) -> str:
    """Return a text without the frames and line breaks of its layout."""
    return " ".join(text.translate(str.maketrans("│─╭╮╰╯", " " * 6)).split())


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "neurosnap", *map(str, arguments)]


def finish(process: Command) -> tuple[int, str, str]:
    """Wait for a command; return its exit code, stdout and stderr."""
    stdout, stderr = process.communicate(timeout=PATIENCE)
    return process.wait(PATIENCE), stdout, stderr


@contextmanager
def started(
    *arguments: object, folder: Path, largest: int | None = None
) -> Iterator[Command]:
    """Start a command in a session of its own; whatever happens, leave none of it."""
    with Command(
        *arguments, folder=folder, own_session=True, largest=largest
    ) as process:
        family = psutil.Process(process.pid)
        try:
            yield process
        finally:
            if process.poll() is None:
                kill([*family.children(recursive=True), family])


# Recordings to work on ----------------------------------------------------------------


def readings(rows: int, *, time: bool = False) -> str:
    """Return a CSV in which `a` implies `b`, and `c` goes its own way."""
    lines = ["time,a,b,c" if time else "a,b,c"]
    for row in range(rows):
        a, b, c = row % 3 == 0, row % 3 != 1, row % 5 < 2
        stamp = f"{row / 10:.1f}," if time else ""
        lines.append(f"{stamp}{a:d},{b:d},{c:d}")
    return "\n".join(lines) + "\n"


@pytest.fixture
def csv(tmp_path: Path) -> Path:
    path = tmp_path / "readings.csv"
    path.write_text(readings(40), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of a path of 20 sensors, 30 ticks."""
    path = tmp_path_factory.mktemp("log") / "path.mcap"
    happy(
        "run", "neurosnap/Path-v0", "--ticks", 30, "--seed", 4, "--threshold", 0.1,
        "--cells", "inline", "--out", path,
    )  # fmt: skip
    return path


def changed(log: Path, target: Path) -> Path:
    """Record again what `log` holds, with another decision at tick 9."""
    recording = Recording.open(log)
    with Writer(target) as writer:
        writer.start(recording.metadata)
        for recorded in recording.messages():
            delivery, message = recorded.delivery, recorded.message
            if isinstance(message, wire.Decision) and message.tick == 9:
                lie = msgspec.structs.replace(message, action=message.action + 1)
                delivery = delivery._replace(payload=wire.encode(lie))
            writer.add(delivery, recorded.log_time)
        writer.finish({}, recording.noted().expected)
    return target


def cut(log: Path, target: Path, *, chunk: int = 4000) -> Path:
    """Record again what `log` holds, in small chunks, and take the second half off."""
    recording, whole = Recording.open(log), target.with_suffix(".whole")
    with Writer(whole, chunk=chunk) as writer:
        writer.start(recording.metadata)
        for recorded in recording.messages():
            writer.add(recorded.delivery, recorded.log_time)
        writer.finish({}, recording.noted().expected)
    target.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    return target


def foreign(target: Path) -> Path:
    target.write_bytes(b"PK\x03\x04 this is no recording" * 20)
    return target


# Help ---------------------------------------------------------------------------------


def test_every_verb_is_known_here() -> None:
    callbacks = [info.callback for info in app.registered_commands]
    assert [getattr(verb, "__name__", None) for verb in callbacks] == list(VERBS)


@pytest.mark.parametrize("verb", VERBS)
def test_a_verb_explains_itself(verb: str) -> None:
    result = call(verb, "--help")
    assert result.exit_code == 0
    assert "--json" in result.stdout
    assert result.stderr == ""


def test_help_says_what_happens_without_an_option() -> None:
    said = call("run", "--help").stdout
    assert "(logs/SOURCE" in said  # its bracket was not taken for a style
    assert "Example: neurosnap run" in said


def test_help_lists_the_verbs() -> None:
    result = call("--help")
    assert result.exit_code == 0
    assert all(verb in result.stdout for verb in VERBS)


def test_no_verb_is_wrong_usage() -> None:
    assert call().exit_code == 2
    assert "No such command 'fly'" in refused("fly")


# Running ------------------------------------------------------------------------------


def test_an_inline_run_says_what_it_came_to(tmp_path: Path) -> None:
    out = tmp_path / "out.mcap"
    facts = happy(
        "run", "neurosnap/Path-v0", "--ticks", 25, "--threshold", 0.1, "--cells",
        "inline", "--out", out,
    )  # fmt: skip
    assert facts.keys() >= RUN_KEYS
    assert (facts["log"], facts["ticks"], facts["cells"]) == (str(out), 25, 20)
    assert facts["complete"] is True
    assert facts["stopped"] is False
    assert facts["height"] > 0
    assert ["below_1", "below_2"] in facts["implications"]
    verdict = verify(out)
    assert verdict.same
    assert verdict.complete
    assert verdict.ticks == 25


def test_without_json_people_are_told(tmp_path: Path, csv: Path) -> None:
    out = tmp_path / "out.mcap"
    result = call("run", csv, "--cells", "inline", "--threshold", 0.1, "--out", out)
    assert result.exit_code == 0
    told = flat(result.stdout)
    assert "3 (inline, hasse wiring)" in told
    assert "a → b" in told
    assert f"recording: {out}" in told


def test_a_run_that_is_not_recorded_leaves_no_file(tmp_path: Path, csv: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        facts = happy("run", csv, "--cells", "inline", "--no-record")
    assert facts["log"] is None
    assert facts["ticks"] == 40
    assert list(tmp_path.iterdir()) == [csv]


def test_a_recording_gets_a_name_of_its_own(tmp_path: Path, csv: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        logs = [
            happy("run", csv, "--cells", "inline", "--ticks", 3)["log"]
            for _ in range(3)
        ]
        assert all(Recording.open(log).finished for log in logs)
    assert len({*logs}) == 3
    assert all(log.startswith("logs/readings-") for log in logs)


@pytest.mark.parametrize(("ticks", "taken"), [((), 40), (("--ticks", 9), 9)])
def test_a_csv_with_times_is_taken_as_far_as_asked(
    tmp_path: Path, ticks: tuple[object, ...], taken: int
) -> None:
    source, out = tmp_path / "timed.csv", tmp_path / "out.mcap"
    source.write_text(readings(40, time=True), encoding="utf-8")
    facts = happy("run", source, "--cells", "inline", "--out", out, *ticks)
    assert facts["ticks"] == taken
    assert facts["cells"] == 3
    assert verify(out).complete


@pytest.mark.parametrize("wiring", ["hasse", "derived"])
@pytest.mark.parametrize(
    "snapshot",
    [("empirical",), ("discounted", "--decay", 0.9, "--threshold", 0.15)],
    ids=["empirical", "discounted"],
)
def test_options_are_kept_in_the_recording(
    tmp_path: Path, csv: Path, wiring: str, snapshot: tuple[object, ...]
) -> None:
    out = tmp_path / "out.mcap"
    facts = happy(
        "run", csv, "--cells", "inline", "--out", out, "--wiring", wiring,
        "--seed", 7, "--snapshot", *snapshot,
    )  # fmt: skip
    metadata = Recording.open(out).metadata
    assert (metadata["wiring"], metadata["snapshot"]) == (wiring, snapshot[0])
    assert (metadata["seed"], metadata["source"]) == ("7", str(csv))
    assert facts["complete"] is True


WRONG_RUNS: dict[str, tuple[tuple[object, ...], str]] = {
    "unknown world": (
        ("neurosnap/Pat-v0",),
        "source: must be a registered environment id or a CSV file (did you mean"
        " neurosnap/Path-v0",
    ),
    "unknown module": (("nowhere.at.all:Path-v0",), "source: must be an environment"),
    "missing file": (
        ("none.csv",),
        "source: must be a file that can be read (No such file or directory),"
        " got 'none.csv'",
    ),
    "threshold": (
        ("CSV", "--threshold", 0.7),
        "threshold: must be in (0, 0.25], got 0.7",
    ),
    "threshold 0": (("CSV", "--threshold", 0), "threshold: must be in (0, 0.25], got"),
    "threshold NaN": (("CSV", "--threshold", "nan"), "threshold: must be in (0, 0.25]"),
    "threshold text": (
        ("CSV", "--threshold", "low"),
        "Invalid value for '--threshold'",
    ),
    "decay 1": (
        ("CSV", "--snapshot", "discounted", "--decay", 1),
        "decay: must be in [0, 1), got 1.0",
    ),
    "decay NaN": (
        ("CSV", "--snapshot", "discounted", "--decay", "nan"),
        "decay: must be in [0, 1), got nan",
    ),
    "decay alone": (
        ("CSV", "--decay", 0.5),
        "decay: must go with a discounted snapshot only, got 0.5",
    ),
    "ticks 0": (("CSV", "--ticks", 0), "ticks: "),
    "ticks below": (("CSV", "--ticks", -5), "got -5"),
    "ticks text": (("CSV", "--ticks", "many"), "Invalid value for '--ticks'"),
    "seed below": (
        ("CSV", "--seed", -1),
        "seed: must be in [0, 9223372036854775807], got",
    ),
    "seed large": (("CSV", "--seed", 2**63), "seed: "),
    "deadline 0": (("CSV", "--deadline", 0), "deadline: "),
    "deadline NaN": (("CSV", "--deadline", "nan"), "deadline: "),
    "deadline endless": (("CSV", "--deadline", "inf"), "deadline: "),
    "wiring": (("CSV", "--wiring", "wired"), "'wired' is not one of 'hasse'"),
    "cells": (("CSV", "--cells", "threads"), "'threads' is not one of 'process'"),
    "snapshot": (("CSV", "--snapshot", "photo"), "'photo' is not one of 'empirical'"),
    "option": (("CSV", "--speed", 3), "No such option"),
    "no source": ((), "Missing argument"),
}


@pytest.mark.parametrize("what", WRONG_RUNS)
def test_a_wrong_run_is_refused_before_anything_is_written(
    tmp_path: Path, csv: Path, what: str
) -> None:
    given, said = WRONG_RUNS[what]
    arguments = [csv if argument == "CSV" else argument for argument in given]
    out = tmp_path / "out.mcap"
    text = refused("run", "--cells", "inline", "--out", out, *arguments)
    assert said in text
    assert not out.exists()


BAD_FILES = {
    "no text": (b"", "must have a header of sensor names"),
    "no rows": (b"a,b\n", "must have rows below its header, got 0"),
    "a cell too few": (b"a,b\n1,0\n1\n", ":3: must have 2 cells"),
    "no bit": (b"a,b\n1,0\n1,2\n", ":3: b: must be 0 or 1, got '2'"),
    "NaN": (b"a,b\n1,nan\n", ":2: b: must be 0 or 1, got 'nan'"),
    "no names": (b"1,0\n0,1\n", ":1: must be a header of sensor names"),
    "one name twice": (b"a,a\n1,0\n", "a"),
    "binary": (b"\xff\xfe\x00", "must be UTF-8 text"),
}


@pytest.mark.parametrize("what", BAD_FILES)
def test_a_bad_file_is_refused_with_the_place(tmp_path: Path, what: str) -> None:
    content, said = BAD_FILES[what]
    source, out = tmp_path / "bad.csv", tmp_path / "out.mcap"
    source.write_bytes(content)
    text = refused("run", source, "--out", out)
    assert f"error: source: {source}" in text
    assert said in text
    assert not out.exists()


def test_an_existing_recording_is_left_alone(tmp_path: Path, csv: Path) -> None:
    out = tmp_path / "out.mcap"
    out.write_text("precious")
    text = refused("run", csv, "--out", out)
    assert f"out: must not exist yet, got '{out}'" in text
    assert out.read_text() == "precious"


def test_a_missing_folder_is_not_made(tmp_path: Path, csv: Path) -> None:
    out = tmp_path / "none" / "out.mcap"
    text = refused("run", csv, "--out", out)
    assert f"out: must be in a folder that exists, got '{out}'" in text
    assert not out.parent.exists()


# Replaying ----------------------------------------------------------------------------


def test_a_true_recording_verifies(log: Path) -> None:
    facts = happy("replay", log, "--verify")
    assert (facts["same"], facts["complete"], facts["ticks"]) == (True, True, 30)
    told = call("replay", log, "--verify").stdout
    assert "every state and decision of 30 ticks came out the same" in flat(told)


def test_a_tampered_recording_fails(log: Path, tmp_path: Path) -> None:
    result = call("replay", changed(log, tmp_path / "lie"), "--verify", "--json")
    assert result.exit_code == 1
    facts = last_json(result.stdout)
    assert facts["same"] is False
    assert facts["difference"].startswith("tick 9: /decide coordinator ")
    assert "different: tick 9: /decide" in flat(result.stderr)


def test_a_truncated_recording_is_lacking(log: Path, tmp_path: Path) -> None:
    result = call("replay", cut(log, tmp_path / "cut"), "--verify", "--json")
    assert result.exit_code == 3
    facts = last_json(result.stdout)
    assert (facts["same"], facts["complete"]) == (True, False)
    assert 0 < facts["ticks"] < 30
    assert "the recording is incomplete" in result.stderr


@pytest.mark.parametrize(
    "arguments",
    [("replay", "LOG", "--verify"), ("replay", "LOG", "--resume"), ("replay", "LOG"),
     ("info", "LOG"), ("graph", "LOG"), ("depth", "LOG")],
    ids=" ".join,
)  # fmt: skip
def test_what_is_no_recording_is_an_error_that_names_it(
    tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    strange, none = foreign(tmp_path / "strange.zip"), tmp_path / "none.mcap"
    for path, told in ((strange, failed), (none, refused), (tmp_path, refused)):
        given = [path if argument == "LOG" else argument for argument in arguments]
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(tmp_path)
            assert str(path) in told(*given)
    assert list(tmp_path.iterdir()) == [strange]


def test_a_run_goes_on(log: Path, tmp_path: Path) -> None:
    out = tmp_path / "more.mcap"
    facts = happy("replay", log, "--resume", "--ticks", 42, "--out", out)
    assert facts.keys() >= RUN_KEYS | {"resumed", "resumed_at"}
    assert (facts["resumed"], facts["resumed_at"]) == (str(log), 30)
    assert (facts["log"], facts["ticks"]) == (str(out), 42)
    assert happy("replay", out, "--verify")["ticks"] == 42


def test_a_cut_run_goes_on(log: Path, tmp_path: Path) -> None:
    half, out = cut(log, tmp_path / "cut"), tmp_path / "more.mcap"
    facts = happy("replay", half, "--resume", "--ticks", 35, "--out", out)
    assert 0 < facts["resumed_at"] < 30
    assert happy("replay", out, "--verify")["ticks"] == 35


def test_a_run_of_a_file_goes_on_to_the_end_of_the_file(
    tmp_path: Path, csv: Path
) -> None:
    log, out, again = (tmp_path / name for name in ("log", "out", "again"))
    happy("run", csv, "--cells", "inline", "--ticks", 10, "--out", log)
    assert happy("replay", log, "--resume", "--out", out)["ticks"] == 40
    text = refused("replay", out, "--resume", "--out", again)
    assert "ticks: must be more than the 40 there are" in text
    csv.unlink()
    assert "No such file" in refused("replay", log, "--resume", "--out", again)
    assert not again.exists()


@pytest.mark.parametrize("ticks", [30, 1, 0, -4])
def test_a_run_does_not_go_on_to_where_it_has_been(
    log: Path, tmp_path: Path, ticks: int
) -> None:
    out = tmp_path / "out.mcap"
    text = refused("replay", log, "--resume", "--ticks", ticks, "--out", out)
    assert "ticks: must be more than the 30 there are" in text
    assert f"got {ticks}" in text
    assert not out.exists()


def test_a_tampered_run_does_not_go_on(log: Path, tmp_path: Path) -> None:
    lie, out = changed(log, tmp_path / "lie"), tmp_path / "out.mcap"
    text = failed("replay", lie, "--resume", "--out", out)
    assert f"{lie}: must be a true run: tick 9: /decide" in text
    assert not out.exists()


def test_verifying_and_resuming_at_once_is_refused(log: Path) -> None:
    assert "must verify or resume" in refused("replay", log, "--verify", "--resume")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--from", 3), "from: must come with --verify, got 3"),
        (("--from", 3, "--resume"), "from: must come with --verify, got 3"),
        (("--ticks", 40), "ticks: must come with --resume, got 40"),
        (("--out", "x.mcap", "--verify"), "out: must come with --resume, got"),
        (("--rate", 2, "--verify"), "rate: must come without --verify and --resume"),
        (("--start", 2, "--resume"), "start: must come without --verify and"),
        (("--step", "--verify"), "step: must come without --verify and --resume"),
        (("--listen", "tcp/127.0.0.1:1", "--verify"), "listen: must come without"),
    ],
    ids=lambda given: given if isinstance(given, str) else " ".join(map(str, given)),
)
def test_a_flag_that_replay_would_not_heed_is_refused(
    log: Path, arguments: tuple[object, ...], said: str
) -> None:
    assert said in refused("replay", log, *arguments)


def test_a_recording_plays_beyond_this_machine_only_where_that_is_asked_for(
    log: Path, tmp_path: Path
) -> None:
    everywhere = ("replay", log, "--listen", "tcp/0.0.0.0:0")
    assert "without TLS (--insecure)" in refused(*everywhere)
    none = tmp_path / "none.mcap"
    assert "log: must exist" in refused("replay", none, *everywhere[2:], "--insecure")
    keys = ("replay", log, "--listen", "tls/localhost:1", "--tls", tmp_path)
    assert str(tmp_path) in refused(*keys)


@pytest.mark.zenoh
def test_the_id_a_stranger_recorded_is_shown_as_it_is(
    tmp_path: Path, endpoint: str
) -> None:
    log = tmp_path / "log.mcap"
    with Writer(log) as writer:
        writer.start({"swarm": "[/red]\x1b"})
        writer.finish({}, {})
    result = call("replay", log, "--listen", endpoint)
    assert f"playing on {endpoint} under neurosnap/'[/red]\\x1b'/**" in flat(
        result.stderr
    )


@pytest.fixture
def endpoint() -> Iterator[str]:
    with tempfile.TemporaryDirectory(prefix="ns-") as folder:
        yield f"unixsock-stream/{folder}/hub"


@pytest.mark.zenoh
def test_a_recording_plays(log: Path, endpoint: str) -> None:
    count = sum(1 for _ in Recording.open(log).messages())
    facts = happy("replay", log, "--rate", 1e6, "--listen", endpoint)
    assert (facts["ticks"], facts["messages"]) == (30, count)
    facts = happy("replay", log, "--rate", 1e6, "--start", 20, "--listen", endpoint)
    assert facts["ticks"] == 11


@pytest.mark.zenoh
def test_enter_plays_a_tick(log: Path, endpoint: str) -> None:
    # Three times Enter, then the end of the input.
    facts = happy("replay", log, "--step", "--listen", endpoint, stdin="\n\n\n")
    assert facts["ticks"] == 3


@pytest.mark.zenoh
def test_a_cut_recording_plays_and_says_so(
    log: Path, tmp_path: Path, endpoint: str
) -> None:
    half = cut(log, tmp_path / "cut")
    result = call("replay", half, "--rate", 1e6, "--listen", endpoint, "--json")
    assert result.exit_code == 3
    assert 0 < last_json(result.stdout)["ticks"] < 30


@pytest.mark.zenoh
@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--rate", 0, "rate: must be positive and finite, got 0.0"),
        ("--rate", "nan", "rate: must be positive and finite, got nan"),
        ("--start", 0, "start: must be in [1, 30], got 0"),
        ("--start", 31, "start: must be in [1, 30], got 31"),
    ],
)
def test_a_wrong_playback_is_refused(
    log: Path, endpoint: str, option: str, value: object, said: str
) -> None:
    result = call("replay", log, option, value, "--listen", endpoint)
    assert result.exit_code == 2
    assert said in flat(result.stderr)
    assert "playing" not in result.stderr


@pytest.mark.zenoh
def test_a_port_in_use_is_an_error(log: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        tcp = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        said = failed("replay", log, "--listen", tcp)
    assert f"hub: must be able to listen on {tcp}, got" in said
    assert "Address already in use" in said
    assert ".rs:" not in said


# Looking into a recording -------------------------------------------------------------


def test_info_says_what_is_in_a_recording(log: Path, tmp_path: Path) -> None:
    facts = happy("info", log)
    assert facts["path"] == str(log)
    assert facts["messages"] == sum(1 for _ in Recording.open(log).messages())
    assert "/observe" in call("info", log).stdout
    lacking = call("info", cut(log, tmp_path / "cut"), "--json")
    assert lacking.exit_code == 3
    assert json.loads(lacking.stdout)["messages"] < facts["messages"]


def test_graph_names_what_was_learned(log: Path) -> None:
    facts = happy("graph", log)
    assert facts["tick"] == 30
    assert ["below_18", "below_19"] in facts["implications"]
    earlier = happy("graph", log, "--at", 0)
    assert (earlier["tick"], earlier["implications"]) == (0, [])
    assert json.loads(call("graph", log).stdout) == facts


@pytest.mark.parametrize(
    ("form", "start"), [("dot", "digraph"), ("graphml", "<?xml"), ("json", "{")]
)
def test_graph_speaks_other_formats(log: Path, form: str, start: str) -> None:
    result = call("graph", log, "--format", form, "--at", 12)
    assert result.exit_code == 0
    assert result.stdout.startswith(start)
    assert result.stderr == ""


def test_a_wrong_graph_is_refused(log: Path) -> None:
    assert "tick: must be in [0, 30], got 31" in refused("graph", log, "--at", 31)
    assert "tick: must be in [0, 30], got -1" in refused("graph", log, "--at", -1)
    assert "format: must be json, dot or graphml, got 'png'" in refused(
        "graph", log, "--format", "png"
    )


def test_depth_of_a_recording(log: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "folder"
    facts = happy("depth", log, "--out", out)
    assert facts["waves"] == len(facts["rows"]) == 60
    lines = (out / "depth.csv").read_text().splitlines()
    assert lines[0] == "sensors,wiring,height,depth,longest,pulses,seconds"
    assert len(lines) == 1 + 60
    assert (out / "depth.png").read_bytes().startswith(b"\x89PNG")
    assert {path.name for path in out.iterdir()} == {"depth.csv", "depth.png"}


def test_depth_needs_a_folder_to_write_to(log: Path, tmp_path: Path) -> None:
    taken = tmp_path / "taken"
    taken.write_text("precious")
    assert f"{taken}: File exists" in failed("depth", log, "--out", taken)
    assert taken.read_text() == "precious"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--heights", "1,two"), "heights: must be whole numbers, got '1,two'"),
        (("--heights", ""), "heights: must be whole numbers, got ''"),
        (("--heights", "1,,2"), "heights: must be whole numbers"),
        (("--heights", "-1,2"), "heights: must be one or more numbers, each at least"),
        (("--heights", "4", "--sensors", "4"), "sensors: must be more than the larg"),
        (("--heights", "4", "--sensors", "x"), "sensors: must be whole numbers"),
        (("--heights", "1", "--waves", 0), "waves: must be at least 1, got 0"),
        (("--wiring", "wired"), "'wired' is not one of 'hasse'"),
    ],
)
def test_a_wrong_depth_is_refused(
    tmp_path: Path, arguments: tuple[object, ...], said: str
) -> None:
    result = call("depth", *arguments, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert said in flat(result.stderr)
    assert list(tmp_path.iterdir()) == []


def test_doctor_exits_by_what_it_finds() -> None:
    result = call("doctor", "--json")
    findings = last_json(result.stdout)["findings"]
    assert findings
    assert result.exit_code == (0 if all(f["ok"] for f in findings) else 1)


# Swarms of processes ------------------------------------------------------------------


def wait_for_size(process: Command, log: Path, size: int) -> None:
    """Wait until a recording has grown to `size`; fail if the command ends before."""
    with pytest.raises(subprocess.TimeoutExpired):
        for _ in range(int(PATIENCE / 0.02)):
            try:
                process.wait(0.02)
            except subprocess.TimeoutExpired:
                if log.exists() and log.stat().st_size >= size:
                    raise
                continue
            pytest.fail(f"it ended early: {process.communicate()[1]}")
        pytest.fail(f"{log} did not grow")


def gone(processes: list[psutil.Process]) -> bool:
    _, alive = psutil.wait_procs(processes, timeout=PATIENCE)
    kill(alive)
    return not alive


def kill(processes: Iterable[psutil.Process]) -> None:
    for process in processes:
        with suppress(psutil.NoSuchProcess):
            process.kill()


@pytest.fixture
def endless(tmp_path: Path) -> Path:
    """A file of readings that takes longer than any test."""
    path = tmp_path / "endless.csv"
    path.write_text(readings(50_000), encoding="utf-8")
    return path


GROWN = 30_000  # bytes a recording has once the run is well under way


@contextmanager
def going(
    source: Path, log: Path, *options: object
) -> Iterator[tuple[Command, list[psutil.Process]]]:
    """Run a swarm of three process cells; entered once it is under way.

    Yields the launcher and the parts, in the order they were started.
    """
    arguments = ("run", source, "--out", log, "--json", *options)
    with started(*arguments, folder=log.parent) as process:
        wait_for_size(process, log, GROWN)
        family = psutil.Process(process.pid).children(recursive=True)
        try:
            yield process, family
        finally:
            kill(family)


def parts_of(family: list[psutil.Process]) -> list[psutil.Process]:
    """Return a swarm's parts, in the order they were started: the cells come last."""
    servers = {parent for each in family if (parent := each.parent()) in family}
    parts = [each for each in family if each.parent() in servers]
    return sorted(parts, key=lambda each: (each.create_time(), each.pid))


def sound(log: Path) -> Verdict:
    """Verify a recording of a run that was disturbed: what there is of it is true."""
    verdict = verify(log)
    assert verdict.difference is None
    assert verdict.ticks > 0
    return verdict


@pytest.mark.zenoh
def test_a_run_of_processes_that_goes_on(tmp_path: Path, csv: Path) -> None:
    one, other = tmp_path / "one.mcap", tmp_path / "other.mcap"
    runs = (
        (("run", csv, "--ticks", 25, "--out", one), one, 25),
        (("replay", one, "--resume", "--out", other), other, 40),
    )
    for arguments, log, ticks in runs:
        with started(*arguments, "--json", folder=tmp_path) as process:
            code, stdout, stderr = finish(process)
        assert code == 0, stderr
        assert "Traceback" not in stderr
        facts = last_json(stdout)
        assert facts.keys() >= RUN_KEYS
        assert facts["log"] == str(log)
        assert (facts["ticks"], facts["cells"], facts["complete"]) == (ticks, 3, True)
        verdict = sound(log)
        assert verdict.complete
        assert verdict.ticks == ticks
        assert facts.get("resumed_at") == (25 if log == other else None)


@pytest.mark.zenoh
def test_two_runs_at_once_do_not_meet(tmp_path: Path, csv: Path) -> None:
    arguments = ("run", csv, "--json")
    with (
        started(*arguments, "--seed", 1, folder=tmp_path) as one,
        started(*arguments, "--seed", 2, folder=tmp_path) as other,
    ):
        ends = [finish(process) for process in (one, other)]
    assert [code for code, _, _ in ends] == [0, 0], ends
    logs = [tmp_path / last_json(stdout)["log"] for _, stdout, _ in ends]
    assert logs[0] != logs[1]
    recordings = [Recording.open(log) for log in logs]
    assert recordings[0].swarm != recordings[1].swarm
    for log, seed in zip(logs, ("1", "2"), strict=True):
        assert Recording.open(log).metadata["seed"] == seed
        verdict = sound(log)
        assert verdict.complete
        assert verdict.ticks == 40


@pytest.mark.zenoh
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["INT", "TERM"])
def test_a_run_that_is_interrupted_ends_in_order(
    tmp_path: Path, endless: Path, number: signal.Signals
) -> None:
    log = tmp_path / "out.mcap"
    with going(endless, log) as (process, family):
        if number is signal.SIGINT:
            os.killpg(process.pid, number)  # as a terminal does: to all of them
        else:
            process.send_signal(number)
        code, stdout, stderr = finish(process)
        assert gone(family)
    assert code == 0, stderr
    facts = last_json(stdout)
    assert (facts["stopped"], facts["complete"]) == (True, True)
    verdict = sound(log)
    assert verdict.complete
    assert verdict.ticks == facts["ticks"] < 50_000


@pytest.mark.zenoh
def test_a_cell_that_is_killed_is_named(tmp_path: Path, endless: Path) -> None:
    log = tmp_path / "out.mcap"
    with going(endless, log, "--restart", "never") as (process, family):
        *_, last = parts_of(family)
        last.kill()
        code, stdout, stderr = finish(process)
        assert gone(family)
    assert code == 1
    assert "cell/2" in stderr
    assert "cell/1" not in stderr
    assert "Traceback" not in stderr
    assert stdout == ""
    assert not sound(log).complete


@pytest.mark.zenoh
def test_a_launcher_that_is_killed_leaves_nothing(
    tmp_path: Path, endless: Path
) -> None:
    log = tmp_path / "out.mcap"
    with (
        tempfile.TemporaryDirectory(prefix="ns-") as folder,
        pytest.MonkeyPatch.context() as patch,
    ):
        patch.setenv("TMPDIR", folder)
        patch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
        with going(endless, log) as (process, family):
            assert len(family) >= 7  # hub, recorder, coordinator, world, cells
            process.kill()
            process.wait()
            assert gone(family)
        # The hub's socket, and the fork server's own.
        left = [path.name for path in Path(folder).iterdir()]
    assert left == []
    sound(log)


@pytest.mark.zenoh
def test_a_full_disk_is_named_and_what_is_there_is_readable(
    tmp_path: Path, endless: Path
) -> None:
    log = tmp_path / "out.mcap"
    most = 100_000

    arguments = ("run", endless, "--out", log, "--json")
    with started(*arguments, folder=tmp_path, largest=most) as process:
        code, stdout, stderr = finish(process)
    assert code == 1, stderr
    assert stdout == ""
    assert str(log) in flat(stderr)
    assert "Traceback" not in stderr
    assert log.stat().st_size <= most
    assert not sound(log).complete
    assert call("replay", log, "--verify").exit_code == 3
    assert call("info", log).exit_code == 3


@pytest.mark.zenoh
def test_depth_is_measured_in_swarms(tmp_path: Path) -> None:
    arguments = ("--heights", "1,3", "--sensors", "4", "--waves", "2", "--json")
    with started("depth", *arguments, folder=tmp_path) as process:
        code, stdout, stderr = finish(process)
    assert code == 0, stderr
    facts = last_json(stdout)
    assert [row["height"] for row in facts["rows"]] == [1, 1, 3, 3]
    assert [row["depth"] for row in facts["rows"]] == [1, 1, 3, 3]
    assert facts["line"] is not None
    assert {path.name for path in tmp_path.iterdir()} == {"depth.csv", "depth.png"}


@pytest.mark.zenoh
def test_interrupting_a_step_does_not_wait_for_enter(
    log: Path, tmp_path: Path, endpoint: str
) -> None:
    process = subprocess.Popen(
        command("replay", log, "--step", "--listen", endpoint),
        cwd=tmp_path,
        stdin=subprocess.PIPE,  # open, and nobody types
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    with process:
        try:
            assert process.stderr is not None
            shown = ""
            while "tick 1: Enter" not in shown:
                letter = process.stderr.read(1)
                assert letter, shown
                shown += letter
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE) == 0
        finally:
            process.kill()
