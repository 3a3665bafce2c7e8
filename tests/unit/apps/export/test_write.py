"""Tables of a recording, compared with what was recorded."""

import csv
import io
import os
import resource
import signal
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.apps.export.table import Exported, export
from neurosnap.errors import InvalidValueError, MissingExtraError, RecordingError
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write.writer import Writer
from tests.support.inline_runs import (
    ACTIONS,
    implying_rows,
    record_scripted,
    scripted_options,
)
from tests.support.lamp import BIRTH, GROWN, lamp_options
from tests.support.recorded_messages import of_type
from tests.support.recorded_runs import recorded as run_recorded
from tests.support.recorded_runs import without_states
from tests.support.scripted_sources import Scripted

TICKS = 40
NAMES = ("depth", "front.door", 'a "b" & c')
FORMS = ("csv", "parquet")


def recorded(log: Path) -> Path:
    """Record a run in this process, of which not all is read."""
    options = scripted_options(
        TICKS,
        body=Body.full(NAMES, ACTIONS),
        keyframe_every=10,
        watch=True,
        support=1,
    )
    return record_scripted(
        Scripted(implying_rows(TICKS, 5, 0.2), ACTIONS), options, log
    )


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("run") / "log.mcap")


def exported(log: Path, out: Path, **options: bool) -> Exported:
    return export(Recording.open(log), out, **options)


def table(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(path.read_text(encoding="utf-8"))))


def bit(packed: bytes, number: int) -> bool:
    return bool(packed[number // 8] >> number % 8 & 1)


def test_a_row_of_csv_is_what_was_recorded_of_a_tick(log: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    assert exported(log, out) == Exported(str(out), TICKS, 0, True)
    got, recording = table(out), Recording.open(log)
    sent = [each.sent for each in recording.messages(("observation",))]
    observations, states = of_type(log, wire.Observation), of_type(log, wire.State)
    decisions = {one.tick: one for one in of_type(log, wire.Decision)}
    ticks = [int(row["tick"]) for row in got]
    assert ticks == [one.tick for one in observations] == [one.tick for one in states]
    sensors = recording.options.sensors
    for row, at, observation, state in zip(
        got, sent, observations, states, strict=True
    ):
        assert np.datetime64(row["time"].removesuffix("Z")).astype(int) == at
        assert row["begins"] == str(int(observation.begins))
        assert row["incoherent"] == str(int(state.incoherent))
        for name in ("depth", "height", "edges", "pulses"):
            assert row[name] == str(getattr(state, name))
        for number, name in enumerate(sensors):
            sure = not observation.known or bit(observation.known, number)
            # A sensor is called like the depth, which is called so already.
            cell = row["depth_" if name == "depth" else name]
            assert cell == (str(int(bit(observation.bits, number))) if sure else "")
            own = bit(state.literals, 2 * number)
            other = bit(state.literals, 2 * number + 1)
            assert row["state"][number] == ("T" if own else "F" if other else "?")
        # A decision is named after its action; the last tick may have none.
        named = "", ""
        if decision := decisions.get(state.tick):
            named = ("go", "stay")[decision.action], decision.why
        assert (row["decision"], row["why"]) == named
    assert any(row[NAMES[1]] == "" for row in got)


def test_parquet_equals_csv_and_is_written_in_groups(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    exported(log, tmp_path / "out.csv")
    monkeypatch.setattr("neurosnap.apps.export.table._CELLS", 200)
    exported(log, tmp_path / "out.parquet")
    assert pq.ParquetFile(tmp_path / "out.parquet").num_row_groups > 3
    got = pq.read_table(tmp_path / "out.parquet")
    rows = list(csv.reader(io.StringIO((tmp_path / "out.csv").read_text())))
    assert got.column_names == rows[0]
    columns = []
    for column in got.columns:
        if column.type == pa.timestamp("ns", tz="UTC"):
            times = column.cast(pa.int64()).to_pylist()
            columns.append([f"{np.datetime64(time, 'ns')}Z" for time in times])
            continue
        # A bit is 1 or 0, a number or a text itself.
        cells = [int(c) if isinstance(c, bool) else c for c in column.to_pylist()]
        columns.append(["" if cell is None else str(cell) for cell in cells])
    assert [list(row) for row in zip(*columns, strict=True)] == rows[1:]


def test_what_is_grown_has_a_column_by_its_formula(tmp_path: Path) -> None:
    options = lamp_options(ticks=TICKS, cells="inline")
    log = run_recorded(options, tmp_path / "lamp.mcap")
    exported(log, tmp_path / "t.csv")
    rows = table(tmp_path / "t.csv")
    assert not any(name.startswith("grown ") for name in rows[0])
    assert {row[GROWN] for row in rows[:BIRTH]} == {""}
    assert {row[GROWN] for row in rows[BIRTH:]} == {"0", "1"}
    assert {len(row["state"]) for row in rows} == {25}
    grew = [(int(row["tick"]), row["grew"]) for row in rows if row["grew"]]
    assert grew == [(BIRTH, GROWN)]
    assert {row["retired"] for row in rows} == {""}


def test_what_a_recording_lacks_is_told(log: Path, tmp_path: Path) -> None:
    without_states(log, tmp_path / "log.mcap", (5, 8))
    done = exported(tmp_path / "log.mcap", tmp_path / "out.csv")
    assert (done.ticks, done.incomplete, done.whole) == (TICKS, 2, False)
    lacking = [row for row in table(tmp_path / "out.csv") if not row["state"]]
    assert [row["tick"] for row in lacking] == ["5", "8"]
    assert all(row["depth"] == row["incoherent"] == "" for row in lacking)


@pytest.mark.parametrize(
    ("message", "sent", "said"),
    [
        (wire.Observation(1, b"\x01\x02\x03\x04"), 1, "tick 1: must be of "),
        (wire.State(1, 1, b"\x01", False, 0, 0, 0, 0, 0), 1, "tick 1: must be of "),
        (wire.Decision(1, 2, "why"), 1, "tick 1: decision: must be one of 2, got 2"),
        (wire.Observation(1, b"\x01\x00\x00"), 2**63, "tick 1: time: must be before"),
    ],
)
def test_what_is_not_of_such_a_run_is_an_error(
    log: Path, tmp_path: Path, message: wire.Message, sent: int, said: str
) -> None:
    with Writer(tmp_path / "log.mcap") as writer:
        writer.start(Recording.open(log).metadata)
        delivery = wire.Delivery(message.key, 0, sent, wire.encode(message))
        writer.add(delivery, 1, message)
        writer.finish({}, {})
    with pytest.raises(RecordingError, match=said):
        exported(tmp_path / "log.mcap", tmp_path / "log.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["log.mcap"]


def test_only_a_file_of_another_thing_is_replaced_and_that_by_force(
    log: Path, tmp_path: Path
) -> None:
    own, out = tmp_path / "log.mcap", tmp_path / "out.csv"
    own.write_bytes(log.read_bytes())
    out.write_text("mine")
    (tmp_path / "link.csv").symlink_to(own)
    (tmp_path / "folder.csv").mkdir()
    os.mkfifo(tmp_path / "pipe.csv")
    for place, force, said in [
        (out, False, "must not exist yet, or come"),
        *(
            (tmp_path / f"{name}.csv", True, "must be another file, not a folder")
            for name in ("link", "folder", "pipe")
        ),
        (tmp_path / "none" / "out.csv", True, "must be in a folder"),
    ]:
        with pytest.raises(InvalidValueError, match=f"^out: {said}"):
            exported(own, place, force=force)
    assert own.read_bytes() == log.read_bytes()
    assert (tmp_path / "pipe.csv").is_fifo()
    assert out.read_text() == "mine"
    exported(own, out, force=True)
    assert len(table(out)) == TICKS


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("mode", [0o600, 0o640])
def test_what_is_exported_is_as_private_as_the_recording(
    log: Path, tmp_path: Path, form: str, mode: int
) -> None:
    own, out = tmp_path / "log.mcap", tmp_path / f"out.{form}"
    own.write_bytes(log.read_bytes())
    own.chmod(mode)
    before = os.umask(0)
    try:
        exported(own, out)
    finally:
        os.umask(before)
    assert out.stat().st_mode & 0o777 == mode


@pytest.mark.parametrize("form", FORMS)
def test_a_full_disk_is_named_with_the_file(
    log: Path, tmp_path: Path, form: str
) -> None:
    out = tmp_path / f"out.{form}"
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, limit[1]))  # EFBIG, like ENOSPC
    try:
        with pytest.raises(OSError, match="too large") as caught:
            exported(log, out)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
        signal.signal(signal.SIGXFSZ, before)
    assert caught.value.filename == str(out)
    assert not list(tmp_path.iterdir())


def test_parquet_without_pyarrow_says_what_to_install(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"^out: must have pyarrow installed"):
        exported(log, tmp_path / "out.parquet")
    assert list(tmp_path.iterdir()) == []
