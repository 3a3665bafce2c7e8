"""What is asked for wrongly is refused before anything starts, by its name."""

from pathlib import Path

import pytest

from neurosnap.apps.config.recording_names import new_path
from tests.support.command_line import call

WORLD = "neurosnap/Path-v0"
TOML = f'[source]\nkind = "world"\nid = "{WORLD}"\n'
UNRECORDED = ("run", WORLD, "--set", "recording.record=false")
NO_RECORDING = "must go with a recording, and nothing is recorded, got"
NO_FOLDER = "out: must name a file that does not exist yet, not a folder, got"
NO_MQTT = 'broker: must go with a TOML file that says kind = "mqtt" under [source], got'
NO_LOG = "log: must exist, got 'none.mcap'"
READING = ("info", "verify", "resume", "learn", "export", "watch", "view", "depth")
ROWS: dict[tuple[str, ...], str] = {
    (*UNRECORDED, "--out", "x.mcap"): f"out: {NO_RECORDING}",
    (*UNRECORDED, "--set", "recording.split=1MiB"): f"recording.split: {NO_RECORDING}",
    ("run", WORLD, "--target", "3"): (
        "target: must go with a planner or an excited agent, got ('3',)"
    ),
    ("run", WORLD, "--out", "."): f"{NO_FOLDER} '.'",
    ("run", WORLD, "--out", "folder"): f"{NO_FOLDER} 'folder'",
    ("run", WORLD, "--out", ""): "out: must have 1 or more characters, got ''",
    ("run", "folder"): (
        "source: must be a registered environment id or a CSV file, not a folder, got"
    ),
    ("run", "none.csv"): "source: must be a file that can be",
    ("run", WORLD, "--broker", "embedded"): f"{NO_MQTT} 'embedded'",
    ("run", "world.toml", "--broker", "here.test"): f"{NO_MQTT} 'here.test'",
    ("info", "folder"): "log: must be a file, got 'folder'",
    **{(verb, "none.mcap"): NO_LOG for verb in READING},
}


@pytest.mark.parametrize("given", ROWS, ids=" ".join)
def test_wrong_usage_is_refused(
    given: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "world.toml").write_text(TOML)
    result = call(*given)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith(f"error: {ROWS[given]}")


@pytest.mark.parametrize(
    ("source", "name"),
    [
        ("mqtt:", "mqtt"),
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
