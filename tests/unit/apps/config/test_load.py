"""Errors of a file that describes a run, with their lines."""

import os
from pathlib import Path

import pytest

from neurosnap.apps.config.load import load
from neurosnap.apps.config.prepare import prepare
from neurosnap.apps.config.problems import ConfigError
from neurosnap.errors import InvalidValueError
from neurosnap.sources.open import open_source

WORLD = '[source]\nkind = "world"\nid = "neurosnap/Path-v0"\narguments.places = 6\n'


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "swarm.toml"


def said(file: Path, text: str | bytes) -> list[str]:
    """Return what is said of a file, a line a fault, without its folder."""
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ConfigError) as caught:
        prepare(load(file))
    assert len(caught.value.faults) == str(caught.value).count("\n") + 1
    return str(caught.value).replace(f"{file.parent}/", "").splitlines()


# What is refused ----------------------------------------------------------------------

VALUES = {
    "[snapshot]\n\nthreshold = 0.7": "7: snapshot.threshold: must be a number in (0, 0.25] or 'auto', got 0.7",
    "[snapshot]\ndecay = 1.0": "6: snapshot.decay: must be a number in [0, 1), got 1.0",
    "[snapshot]\ntreshold = 0.1": "6: snapshot.treshold: must be a known key (did you mean threshold?)",
    "[snapshot]\nkind = 'photo'": "6: snapshot.kind: must be 'discounted' or 'empirical', got 'photo'",
    "[snapshots]": "5: snapshots: must be a known key (did you mean snapshot?)",
    "[[snapshot]]": "5: snapshot: must be a table, got [{}]",
    "[run]\nthreshold = 0.1": "6: run.threshold: must be a known key (did you mean snapshot.threshold?)",
    "[run]\nkind = 1": "6: run.kind: must be a known key (did you mean agent.kind, snapshot.kind or",
    "[run]\nqq = 1": "6: run.qq: must be a known key: ticks or seed",
    "[run]\nticks = 0": "6: run.ticks: must be a whole number in [1, 2147483647], got 0",
    "[agent]\nexplore = nan": "6: agent.explore: must be a number in [0, 1] or 'planned', got nan",
    "[agent]\ntarget = [\n  'a',\n  3\n]": "8: agent.target[1]: must be text, and not empty, got 3",
    "[agent]\ntarget = 1.5": "6: agent.target: must be a whole number, 0 or more, text, and not empty or a list",
    "[cells]\ndeadline = inf": "6: cells.deadline: must be a finite number, more than 0, got inf",
    "[supervision]\nbackoff = -1": "6: supervision.backoff: must be a finite number, 0 or more, got -1",
    "[network]\ninsecure = 1": "6: network.insecure: must be true or false, got 1",
    "[network]\nlisten = 1": "6: network.listen: must be text, got 1",
    "[recording]\npath = ''": "6: recording.path: must be text, and not empty, got ''",
}  # fmt: skip
"""Of each rule one row; that none is overlooked is tested with the schema."""
LIVE = "[source]\nkind = 'stdin'\nsensors = ['a']"
MQTT = "[source]\nkind = 'mqtt'\nsensors = [{ name = 'a', topic = 'a' }]\n"
PATH = "[source]\nkind = 'world'\nid = 'neurosnap/Path-v0'\n"
CSV = "[source]\nkind = 'file'\n"
SOURCES = {
    "": "swarm.toml: source: must be given",
    "source = 1": "swarm.toml:1: source: must be a table, got 1",
    "[source]": "swarm.toml:1: source.kind: must be 'world', 'file', 'stdin', 'zenoh', 'mqtt' or 'ros2'",
    "[source]\nkind = 'tea'": "swarm.toml:2: source.kind: must be 'world', 'file', 'stdin', 'zenoh', 'mqtt' or 'ros2', got",
    "[source]\nkind = 'world'": "swarm.toml:1: source.id: must be given",
    f"{CSV}id = 'x'\npath = 'a.csv'": "swarm.toml:3: source.id: must be a known key: path",
    f"{CSV}path = 'a.txt'": "swarm.toml:3: source.path: must be a file of readings, or the folder of a bag",
    f"{CSV}path = 'a.csv'\n[recording]\npath = 'a.csv'": "swarm.toml:5: recording.path: must not exist yet",
    "[source]\nkind = 'zenoh'\nsensors = ['a']\n[cells]\nkind = 'inline'": (
        "swarm.toml:5: cells.kind: must be 'process' or 'worker' for a source of kind zenoh, got 'inline'"
    ),
    f"{CSV}path = 'none.csv'": "swarm.toml:3: source.path: must be a file that can be read (No such",
    f"{CSV}path = 'bad.csv'": "swarm.toml:3: source.path: bad.csv:3: kind: must be 0 or 1, false or true",
    PATH.replace("Path", "Pat"): "swarm.toml:3: source.id: must be a registered environment id or a CSV file (did",
    f'{PATH}arguments = {{"a b" = [1]}}': 'swarm.toml:4: source.arguments."a b": must be true or false, a whole',
    f"{PATH}arguments = {{colour = 1}}": "swarm.toml:4: source.arguments: must be ones that neurosnap/Path-v0",
    f"{PATH}[source.arguments]\nplaces = 1": "swarm.toml:5: source.arguments.places: must be a whole number of",
    "[source]\n\nknd = 'world'": "swarm.toml:3: source.knd: must be a known key (did you mean kind?)",
    "[source]\nkind = 'stdin'\nbins = -1": "swarm.toml:3: source.bins: must be a whole number, 0 or",
    "[source]\nkind = 'zenoh'\nsensors = []": "swarm.toml:3: source.sensors: must be named for such a",
    f"{LIVE}\ninterval = 1\nmax_interval = 2": "swarm.toml:4: source.interval: must not come with max_",
    f"{MQTT}[source.tick]\nmin_interval = 3\nmax_interval = 2": "swarm.toml:6: source.tick.max_interval: must be min_",
    MQTT.replace("c = 'a'", "c = 'a/#/b'"): "swarm.toml:3: source.sensors[0].topic: must be a topic, without",
    f'{MQTT}[source.broker]\npassword_env = "NO_SUCH"\nusername = "me"': (
        "swarm.toml:5: source.broker.password_env: must be set in the environment, got 'NO_SUCH'"
    ),
}  # fmt: skip
TOGETHER = {
    "[snapshot]\ndecay = 0.5": "6: snapshot.decay: must go with a discounted snapshot only, got 0.5",
    "[agent]\ntarget = 'below_1'": "6: agent.target: must go with a planner or an excited agent, got",
    "[agent]\nkind = 'planner'": "5: agent.target: must name a sensation to achieve",
    "[agent]\nkind = 'planner'\ntarget = [\n'below_1',\n'below_9']": "9: agent.target[1]: must name a sensor that",
    "[agent]\nkind = 'excited'\ntarget = 'below_1'": "7: agent.target: must be the number of a place for an",
    "[agent]\nkind = 'excited'\ntarget = 6": "7: agent.target: must be a place in 0..5",
    "[cells]\nkind = 'worker'\nworkers = 6": "7: cells.workers: must be at least 1 and at most the cells, 5,",
    "[network]\nlisten = 'tcp/0.0.0.0:7447'": "6: network.listen: must be tcp/ on loopback or unixsock-stream/",
    "[network]\nconnect = 'tcp/h:1'\nlisten = 'tcp/h:1'": "6: network.connect: must not come with an endpoint to",
    "[network]\ntls = 'keys'": "6: network.tls: must come with an endpoint to listen on",
    "[recording]\npath = 'swarm.toml'": "6: recording.path: must not exist yet, got",
    "[recording]\npath = 'no/a.mcap'": "6: recording.path: must be in a folder that exists, got 'no/a.mcap'",
    "[recording]\nfolder = 'no/no'": "6: recording.folder: must be a folder, or be in one that exists, got",
}  # fmt: skip
NO_TOML: dict[str | bytes, str] = {
    "a = 1\nb =": "swarm.toml:2: must be TOML: ",
    "a = 1\na = 2\n\n": "swarm.toml:2: must be TOML: Cannot overwrite a value (column",
    'a = """\n\n': "swarm.toml:1: must be TOML: ",
    "a = " + "[" * 10_000: "swarm.toml: must be TOML: nested too deep",
    f"a = {'9' * 5000}": "swarm.toml: must be TOML: Exceeds the limit",
    f"{'a.' * 90_000}a = 1": "swarm.toml: must have keys of at most 20 dots",
    f"[{'a.' * 90_000}a]": "swarm.toml: must have keys of at most 20 dots",
    f"a = {{ {'b . ' * 30}'c'.d = 1 }}": "swarm.toml: must have keys of at most 20 dots",
    f"a =\n[{'1.5, ' * 30}]": "swarm.toml:1: must be TOML: ",  # these are no keys
    "#" * (5 << 20): "swarm.toml: must have at most 4 MiB",
    b"a = '\xff'": "swarm.toml: must be UTF-8 text (invalid start byte at byte 5)",
}

REFUSED: dict[str | bytes, str] = {
    **{f"{WORLD}{table}\n": f"swarm.toml:{line}" for table, line in VALUES.items()},
    **{f"{WORLD}{table}\n": f"swarm.toml:{line}" for table, line in TOGETHER.items()},
    **{f"{text}\n": line for text, line in SOURCES.items()},
    **NO_TOML,
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_wrong_is_refused_with_its_line(file: Path, text: str | bytes) -> None:
    (file.parent / "a.csv").write_text("a,b\n0,1\n")
    (file.parent / "bad.csv").write_text("kind,b\n0,0\nx,1\n")
    (line,) = said(file, text)
    assert line.startswith(REFUSED[text])


def test_a_pipe_or_a_device_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "zero.toml").symlink_to("/dev/zero")
    for name in ("pipe.toml", "zero.toml"):
        with pytest.raises(ConfigError, match="pipe or a device"):
            load(tmp_path / name)
    with pytest.raises(InvalidValueError, match="pipe or a device"):
        open_source(str(tmp_path / "pipe.csv"), 0)


def test_a_missing_file_is_refused(file: Path) -> None:
    text = f"{file}: must be a file that can be read (No such file or directory)"
    with pytest.raises(ConfigError) as caught:
        load(file)
    assert str(caught.value) == text


MISSING = "[source]\nkind = 'file'\npath = 'none.csv'\n"
SEVERAL = {
    "in the order of their lines": (
        f"{WORLD}[run]\nticks = 0\nseeds = 1\n[agent]\nexplore = 2\n[cell]\n",
        ["6: run.ticks", "7: run.seeds", "9: agent.explore", "10: cell"],
    ),
    "of every kind": (
        "[run]\nticks = 0\n[snapshot]\ndecay = 0.5\n[cells]\nworkers = 0\n"
        f"[recording]\nkeep = 3\n[network]\ntls = 'keys'\n{MISSING}",
        [
            "2: run.ticks",
            "4: snapshot.decay",
            "6: cells.workers",
            "8: recording.keep",
            "10: network.tls",
            "13: source.path",
        ],
    ),
    "of tables that do not go together": (
        "[snapshot]\ndecay = 0\n[recording]\nfolder = 'no/no'\n"
        f"[agent]\nkind = 'planner'\n{WORLD}",
        ["2: snapshot.decay", "4: recording.folder", "5: agent.target"],
    ),
    "beside a wrong source": (
        "[source]\nkind = 'wrold'\n[snapshot]\ndecay = 0.5\n",
        ["2: source.kind", "4: snapshot.decay"],
    ),
    "beside a wrong agent": (
        f"[agent]\nkind = 'planer'\n{MISSING}",
        ["2: agent.kind", "5: source.path"],
    ),
    # Whether the rest of its table goes with what was meant cannot be known.
    "but not of what a wrong snapshot spoils": (
        f"{WORLD}[snapshot]\nkind = 'discount'\ndecay = 0.5\n",
        ["6: snapshot.kind"],
    ),
    "but not of what a wrong agent spoils": (
        f"{WORLD}[agent]\nkind = 'planer'\ntarget = 'below_1'\n",
        ["6: agent.kind"],
    ),
    "but not of what a wrong split spoils": (
        f"{WORLD}[recording]\nsplit = -1\nkeep = 3\n",
        ["6: recording.split"],
    ),
}


@pytest.mark.parametrize(("text", "faults"), SEVERAL.values(), ids=SEVERAL)
def test_all_faults_are_told_at_once(file: Path, text: str, faults: list[str]) -> None:
    found = [":".join(line.split(":")[1:3]) for line in said(file, text)]
    assert found == faults


def test_a_mistake_made_over_and_over_is_told_a_hundred_times(file: Path) -> None:
    text = WORLD + "".join(f"[t{number}]\na = 1\n" for number in range(130))
    file.write_text(text)
    with pytest.raises(ConfigError) as caught:
        prepare(load(file))
    lines = str(caught.value).splitlines()
    assert len(lines) == 101
    for number, line in enumerate(lines[:100]):
        assert line.startswith(
            f"{file}:{5 + 2 * number}: t{number}: must be a known key"
        )
    assert (lines[-1], caught.value.more) == ("and 30 more", 30)
