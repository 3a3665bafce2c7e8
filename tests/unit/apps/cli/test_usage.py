"""What is asked for wrongly is refused before anything starts, by its name."""

from pathlib import Path

import pytest

from neurosnap.apps.config.recording_names import new_path
from tests.support.command_line import call

WORLD = """
[source]
kind = "world"
id = "neurosnap/Path-v0"
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "world.toml").write_text(WORLD)
    return tmp_path


def refused(*arguments: object) -> str:
    """Return what is said of wrong usage."""
    result = call(*arguments)
    assert (result.exit_code, result.stdout) == (2, "")
    return result.stderr.removeprefix("error: ").removesuffix("\n")


@pytest.mark.parametrize(
    "flag",
    [
        ("--out", "x.mcap", "out"),
        ("--set", "recording.split=1MiB", "recording.split"),
    ],
)
def test_a_flag_about_a_recording_is_refused_where_there_is_none(
    flag: tuple[str, str, str],
) -> None:
    said = refused(
        "run", "neurosnap/Path-v0", "--set", "recording.record=false", *flag[:2]
    )
    rule = f"{flag[2]}: must go with a recording, and nothing is recorded, got"
    assert said.startswith(rule)


def test_a_target_is_refused_for_who_goes_nowhere() -> None:
    said = refused("run", "neurosnap/Path-v0", "--target", "3")
    assert said == "target: must go with a planner or an excited agent, got ('3',)"


@pytest.mark.parametrize("out", [".", "folder"])
def test_a_recording_is_not_a_folder(out: str) -> None:
    said = refused("run", "neurosnap/Path-v0", "--out", out)
    rule = "must name a file that does not exist yet, not a folder"
    assert said == f"out: {rule}, got '{out}'"


def test_a_recording_has_a_name() -> None:
    said = refused("run", "neurosnap/Path-v0", "--out", "")
    assert said == "out: must have 1 or more characters, got ''"


def test_a_source_is_not_a_folder() -> None:
    said = refused("run", "folder")
    rule = "must be a registered environment id or a CSV file, not a folder"
    assert said == f"source: {rule}, got 'folder'"


@pytest.mark.parametrize("source", ["neurosnap/Path-v0", "world.toml"])
@pytest.mark.parametrize("broker", ["embedded", "here.test"])
def test_a_broker_is_for_mqtt_alone(source: str, broker: str) -> None:
    rule = 'must go with a TOML file that says kind = "mqtt" under [source]'
    assert (
        refused("run", source, "--broker", broker) == f"broker: {rule}, got '{broker}'"
    )


@pytest.mark.parametrize(
    "verb",
    [
        ("info",),
        ("verify",),
        ("resume",),
        ("learn",),
        ("export",),
        ("watch",),
        ("view",),
        ("depth",),
    ],
)
def test_a_recording_that_is_not_there_is_wrong_usage_like_a_missing_csv(
    verb: tuple[str, ...],
) -> None:
    name, *flags = verb
    said = refused(name, "none.mcap", *flags)
    assert said == "log: must exist, got 'none.mcap'"


def test_a_recording_that_is_a_folder_is_wrong_usage() -> None:
    assert refused("info", "folder") == "log: must be a file, got 'folder'"


def test_a_missing_csv_is_wrong_usage() -> None:
    assert refused("run", "none.csv").startswith("source: must be a file that can be")


@pytest.mark.parametrize(
    ("source", "name"),
    [
        ("mqtt:", "mqtt"),
        ("zenoh:", "zenoh"),
        ("-", "stdin"),
        ("gymnasium:CartPole-v1", "gymnasium-cartpole-v1"),
        ("a/Größe 2: <neu>?.csv", "größe-2-neu"),
        ("x" * 300, "x" * 60),
    ],
)
def test_a_recording_has_a_name_that_can_be_copied_anywhere(
    source: str, name: str
) -> None:
    stem, _, _ = new_path(source).name.rsplit("-", 3)[0].partition(".")
    assert stem == name
