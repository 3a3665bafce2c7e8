"""The verb ``model``: names, expressions and recordings in, a picture out."""

import json
import re
import shlex
from pathlib import Path
from typing import Any

import pytest

from neurosnap.apps.drawing.find_model import listed
from tests.support.command_line import call

pytestmark = pytest.mark.slow

PAGE = Path(__file__).parent.parent.parent / "docs" / "viewing.md"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of six ticks of three sensors."""
    folder = tmp_path_factory.mktemp("log")
    rows = ["door,motion,light", *["0,0,0", "0,1,0", "1,1,0", "0,0,1"] * 2]
    (folder / "readings.csv").write_text("\n".join(rows) + "\n")
    path = folder / "a.mcap"
    call("run", str(folder / "readings.csv"), "--cells", "inline", "--out", str(path))
    assert path.exists()
    return path


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def asked(*arguments: str) -> dict[str, Any]:
    result = call("model", *arguments, "--json")
    assert result.exit_code == 0, result.output
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def test_a_name_is_drawn_into_the_current_folder(folder: Path) -> None:
    result = call("model", "simple")
    assert result.exit_code == 0
    assert result.stdout.splitlines() == [
        "A simple poc set and its dual",
        "dual: 5 vertices · 5 edges · 1 square · dimension 2 · height 1 · width 4"
        " · Betti 1, 0, 0",
        "wrote simple.png",
    ]
    assert [path.name for path in folder.iterdir()] == ["simple.png"]


def test_an_expression_is_measured(folder: Path) -> None:
    facts = asked("a,b,c : a<c*, b<c*", "--out", "own.png")
    assert facts["png"] == "own.png"
    assert facts["faces"] == [5, 5, 1]
    assert facts["betti"] == [1, 0, 0]
    assert (facts["height"], facts["width"], facts["dimension"]) == (1, 4, 2)
    assert facts["punctured_betti"] is facts["possible"] is None
    assert (folder / "own.png").stat().st_size > 10_000


def test_the_names_are_listed() -> None:
    result = call("model", "--list")
    assert result.exit_code == 0
    assert [line.split()[0] for line in result.stdout.splitlines()] == list(listed())
    assert asked("--list")["models"] == listed()


def test_help_names_what_can_be_drawn() -> None:
    result = call("model", "--help")
    assert result.exit_code == 0
    assert "NAME|LOG|EXPR" in result.stdout


def test_a_recording_is_drawn_with_its_state(log: Path, folder: Path) -> None:
    facts = asked(str(log))
    assert facts["title"] == "a.mcap: what was learned by tick 8"
    assert facts["sensors"] == 3
    assert facts["possible"] == 1
    assert facts["witnessed"] == 4
    assert facts["png"] is None
    assert not (folder / "a.png").exists()
    assert call("model", str(log)).exit_code == 0
    assert (folder / "a.png").exists()
    assert asked(str(log), "--at", "0")["faces"] == [8, 12, 6, 1]
    early = asked(str(log), "--at", "2")
    assert early["title"].endswith("tick 2")
    assert early["witnessed"] <= 2


def test_some_sensors_of_a_recording_are_drawn(log: Path, folder: Path) -> None:
    facts = asked(str(log), "--only", "light, door", "--out", "some.svg")
    assert facts["title"].endswith("tick 8 (2 of 3 sensors)")
    assert (facts["png"], facts["svg"]) == (None, "some.svg")
    assert facts["elements"] == [["light"], ["door"]]
    assert facts["dual"]["vertices"] == ["10", "01", "00"]
    assert facts["dual"]["witnessed"] == [0, 1, 2]
    assert len(facts["dual"]["possible"]) == 1
    assert (folder / "some.svg").read_text().rstrip().endswith("</svg>")


def test_a_dual_too_large_is_left_out_of_a_recordings_picture(log: Path) -> None:
    facts = asked(str(log), "--at", "0", "--limit", "7")
    assert facts["vertices"] is None
    assert facts["unlisted"] == "it has 8 vertices, more than 7"
    said = call("model", str(log), "--at", "0", "--limit", "7").stdout
    assert "dual not listed: it has 8 vertices, more than 7" in said


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (["sixarcs"], 2, "did you mean six-arcs"),
        ([], 2, "model: must be a name of --list"),
        (["a, b : a < b*, b* < a"], 2, "must have no cycle"),
        (["a, b : a << b"], 2, "relation: must be literals joined by"),
        (["simple", "--limit", "0"], 2, "limit: must be at least 1, got 0"),
        (["grid", "--limit", "20"], 2, "dual: must have at most 20 vertices"),
        (["simple", "--at", "3"], 2, "tick: must be of a recording"),
        (
            ["simple", "--out", "a.jpg"],
            2,
            "out: must end in .png, .svg, .pdf or .tex, got",
        ),
        (["simple", "--only", "a,q"], 2, "q"),
        (
            [
                ",".join(f"s{k}" for k in range(70))
                + " : "
                + " < ".join(f"s{k}" for k in range(70))
            ],
            2,
            "--only A,B",
        ),
        (["simple", "--out", "no/a.png"], 2, "out: must be in a folder that exists"),
        (["missing.mcap"], 2, "missing.mcap"),
        (["foreign.mcap"], 1, "foreign.mcap"),
        (["LOG", "--at", "99"], 2, "tick: must be in [0, 8], got 99"),
    ],
)
def test_bad_input_is_named_and_leaves_nothing(
    log: Path, folder: Path, arguments: list[str], code: int, text: str
) -> None:
    (folder / "foreign.mcap").write_text("somebody else's")
    given = [str(log) if part == "LOG" else part for part in arguments]
    result = call("model", *given)
    assert result.exit_code == code, result.output
    assert text in result.stderr.replace("\n", " ")
    assert "Traceback" not in result.output
    assert [path.name for path in folder.iterdir()] == ["foreign.mcap"]


def test_what_the_manual_shows_works(log: Path, folder: Path) -> None:
    (folder / "a.mcap").write_bytes(log.read_bytes())
    blocks = re.findall(
        r"^```console\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL
    )
    (block,) = [text for text in blocks if "neurosnap model" in text]
    commands = [shlex.split(line, comments=True) for line in block.splitlines()]
    assert [words[:2] for words in commands] == [["neurosnap", "model"]] * 4
    for words in commands:
        assert call(*words[1:]).exit_code == 0, words
    picture = PAGE.parent / "six-way-compass.png"
    assert picture.stat().st_size < 200_000
    assert (folder / "six-arcs.png").read_bytes()[:8] == picture.read_bytes()[:8]
