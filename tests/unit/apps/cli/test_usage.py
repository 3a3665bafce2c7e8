"""Every command rejects wrong usage and names the mistake before it writes anything."""

import shlex
import shutil
from pathlib import Path

import pytest

from tests.support.command_line import call, flat
from tests.support.command_line_files import foreign, readings, record_path

WORLD = "neurosnap/Path-v0"
TOML = f'[source]\nkind = "world"\nid = "{WORLD}"\n'
FILE = "run readings.csv --cells inline"
PATH = f"run {WORLD} --cells inline --set places=5"
GROWS = f"run {WORLD} --agent planner --target below_1 --set agent.grow=1"
NEAR = "tcp/127.0.0.1:1"
SHARED = f"run {WORLD} --set places=7 --swarm a --listen {NEAR} --elsewhere"
UNRECORDED = f"run {WORLD} --set recording.record=false"
NO_RECORDING = "must go with a recording, and nothing is recorded, got"
NO_FOLDER = "out: must be another file, not a folder or what is read, got"
SHARE = "threshold: must be a number in (0, 0.25] or 'auto'"
SPLIT = "run readings.csv --set recording.split"
READING = ("info", "verify", "resume", "learn", "export", "watch", "view", "depth")
ROWS = {
    # What is run.
    "run": "Missing argument",
    "run nowhere.at.all:Path-v0": "source: must be an environment",
    "run folder": "must be a registered environment id or a CSV file, not a folder",
    "run empty.csv": "source: empty.csv: must have a header of sensor names",
    # Options of a run.
    f"{FILE} --speed 3": "No such option",
    f"{FILE} --threshold 0.7": f"{SHARE}, got 0.7",
    f"{FILE} --snapshot discounted --threshold auto": "threshold: must be a number for",
    f"{FILE} --ticks 1{30 * '0'}": "ticks: must be a whole number in [1, 2147483647], got 1000",
    f"run {WORLD} --set places=1000000": "12 bytes for every pair are 12,000.0 GB",
    f"{FILE} --ticks many": "Invalid value for '--ticks'",
    f"{FILE} --set places=4": "arguments: must be ones such a source takes",
    "run readings.csv --cells threads": "'threads' is not one of 'auto'",
    f"{SPLIT}=63KiB": "must be 0, or at least 65536 bytes, got 64512",
    f"{PATH} --set recording.split=64KiB --set recording.keep=2": "keep: must go with",
    f"{UNRECORDED} --out x.mcap": f"out: {NO_RECORDING}",
    f"{UNRECORDED} --set recording.split=1MiB": f"recording.split: {NO_RECORDING}",
    f"{PATH} --set recording.frames=1": (f"the render mode rgb_array, got '{WORLD}'"),
    f"{FILE} --out taken.csv": "out: must not exist yet, got 'taken.csv'",
    f"{FILE} --out .": f"{NO_FOLDER} '.'",
    f"{FILE} --out folder": f"{NO_FOLDER} 'folder'",
    f"{FILE} --out a.txt": "out: must end with .mcap, got 'a.txt'",
    f"{FILE} --out ''": "out: must be text, and not empty, got ''",
    # Agents, and workers.
    f"{FILE} --agent planner --target a": "agent: must have actions that are sensors",
    # A swarm on a network, and its parts as services.
    f"run {WORLD} --listen tcp/0.0.0.0:7447": "listen: must be tcp/ on loopback",
    f"run {WORLD} --listen tls/127.0.0.1:7447": "listen: must come with keys (--tls)",
    f"run {WORLD} --connect tcp/192.0.2.1:7447": "connect: must be tcp/ on loopback",
    f"run {WORLD} --swarm a/b": "swarm: must be letters and digits, got 'a/b'",
    f"run {WORLD} --elsewhere 1": "elsewhere: must come with --swarm ID",
    f"{SHARED} 9": "elsewhere: must be cells of the swarm, 0 to 5, got '9'",
    f"{SHARED} x": "elsewhere: must be like 0-499 or 3,7,9-12, of at most six digits",
    f"serve cells a/b 0 --connect {NEAR}": "swarm: must be letters and digits",
    f"serve cells a --connect {NEAR}": "Missing argument 'RANGES'",
    f"serve cells a 3,3 --connect {NEAR}": "cells: must name each once, got '3,3'",
    f"serve recorder a --out none/x --connect {NEAR}": "out: must be in a folder that",
    f"serve coordinator {WORLD} --swarm '' --connect {NEAR}": "swarm: must be letters",
    # Depth.
    "depth --heights 1,two": "heights: must be whole numbers, got '1,two'",
    "depth --heights 4 --sensors x": "sensors: must be whole numbers",
    "depth --wiring wired": "'wired' is not one of 'hasse'",
    # Data, and recordings.
    "learn readings.csv --at 3": "at: must go with a recording, got 3",
    "learn readings.csv -o taken.csv": "out: must not exist yet, or come with --force",
    "learn readings.csv -o a.png": "out: must end with one of .csv",
    "learn readings.csv --sensors none": "must have this sensor",
    "learn numbers.csv": """nothing for unknown (or --when "t > NUMBER"; for a run, --set when=...), """,
    "learn readings.csv --when warm": "when: must be like",
    "learn readings.csv --threshold 2": "threshold: must be in",
    "learn log.mcap --time then": "must not go with a recording",
    "learn log.mcap -o log.html --at 3 --threshold sure --format png": "'png' is not",
    "learn log.mcap --at 31": "tick: must be in [0, 30], got 31",
    "compare readings.csv": "Missing argument",
    "compare readings.csv none.csv": "source: must be a file that can be read",
    "compare readings.csv log.mcap": "must have a sensor of readings.csv, got 'none'",
    "compare log.mcap readings.csv --time t": "must not go with a recording",
    "compare readings.csv readings.csv -o a.txt": "must end with one of .csv, .json",
    "compare readings.csv readings.csv -o taken.csv": "out: must not exist yet, or come",
    "health readings.csv": "data: must say when each reading was",
    "health readings.csv --zone Mars": "zone: must be a time zone that this machine",
    "health readings.csv --alarms often": "alarms: must be a number a hour, day, week",
    "verify log.mcap --set seed=1": "set: must be one of agent.explore, agent.imagine, ",
    "verify log.mcap --set snapshot.threshold=0.7": f"{SHARE}, got 0.7",
    "verify log.mcap --set agent.target=a": "target: must go with a planner",
    "verify log.mcap --from 9 --set anomalies.hold=1": "from: must go without --set",
    "export log.mcap -o a.xls": "out: must end with one of .csv, ",
    "export log.mcap -o a.mcap --force": "out: must come without --force",
    "export log.mcap -o a.rosbag2 --force": "out: must come without --force",
    "export log.mcap -o taken.csv": "out: must not exist yet, or come with --force",
    "export log.mcap -o none/a.csv": "out: must be in a folder that exists",
    "resume log.mcap --ticks -4": "got -4",
    "info folder": "log: must be a file, got 'folder'",
    **{f"{verb} none.mcap": "log: must exist, got 'none.mcap'" for verb in READING},
    "view log.mcap log.mcap": "log: must be named once, got 'log.mcap'",
    "view log.mcap --port 70000": "port: must be in [0, 65535], got 70000",
    "play log.mcap --listen tcp/0.0.0.0:0": "without TLS (--insecure)",
    "play log.mcap --listen tls/localhost:1 --tls folder": "folder/ca.pem: must be a",
    "play none.mcap": "log: must exist, got 'none.mcap'",
    # A broker's topics.
    "init topics a:b": "broker: must be HOST or HOST:PORT, got 'a:b'",
    "init topics a --topic a+": "topic: must be a topic filter",
    "init topics a -o a.txt": "out: must end with .toml, got 'a.txt'",
    "init topics a -o none/a.toml": "out: must be in a folder that exists",
    "init topics a -o world.toml": "out: must not exist yet, or come with --force",
    "init topics a --ca-file a.pem": "ca_file: must go with tls",
    "init topics a --seconds 0": "--seconds",
}
FAILED = {
    **{
        f"{verb} strange.zip": "strange.zip"
        for verb in (*READING[:3], "view", "depth", "play")
    },
    "export taken.csv": "taken.csv",
    "verify log.mcap --from 99": "must hold a whole tick behind tick 30 to be verified",
    "depth log.mcap --out taken.csv": "taken.csv: File exists",
}
"""What is no wrong usage, and fails."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("usage")
    (folder / "folder").mkdir()
    for name, text in {
        "world.toml": TOML,
        "readings.csv": readings(40),
        "bad.csv": "a,b\n1,0\n1,2\n",
        "numbers.csv": "a,t\n1,21.5\n0,warm\n",
        "empty.csv": "",
        "taken.csv": "precious",
    }.items():
        (folder / name).write_text(text, encoding="utf-8")
    foreign(folder / "strange.zip")
    record_path(folder / "log.mcap")
    return folder


@pytest.mark.parametrize("line", [*ROWS, *FAILED])
def test_it_is_refused_and_nothing_is_written(
    line: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    monkeypatch.chdir(folder)
    result = call(*shlex.split(line))
    assert result.exit_code == (2 if line in ROWS else 1), result.output
    assert result.stdout == ""
    assert (ROWS | FAILED)[line] in flat(result.stderr)
    shutil.rmtree(folder / "logs", ignore_errors=True)
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before
