"""The exit codes of commands that read a damaged or truncated recording."""

from pathlib import Path

import pytest

from neurosnap.apps.viewer.run_view import RunView
from neurosnap.depth import measure
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.replay.find_resume_point import find_resume_point
from neurosnap.recording.write.rotation import Split
from neurosnap.runtime.parts import recorder_process
from tests.support.command_line import call, flat
from tests.support.recorded_runs import in_chunks, path_run, recorded

pytestmark = pytest.mark.slow

VERBS = (
    ("info",),
    ("verify",),
    ("verify", "--set", "anomalies.hold=1"),
    ("learn",),
    ("compare", "{folder}/run.mcap"),
    ("watch",),
    ("depth", "--out", "{folder}"),
    ("export", "--out", "{folder}/out.csv"),
    ("export", "--out", "{folder}/good.mcap"),
)


@pytest.fixture(autouse=True)
def _draws_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measure, "draw", lambda *_: [])  # it takes a second


@pytest.fixture(scope="module")
def contents(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("whole")
    long = recorded(path_run(), folder / "long.mcap")
    whole = in_chunks(long, folder / "whole.mcap", 12000)
    data = whole.read_bytes()
    chunk = Recording.open(whole).files[0].layout.chunks[9]
    spoiled = bytearray(data)
    spoiled[chunk.offset + 50] ^= 1
    return {
        "whole": data,
        "spoiled": bytes(spoiled),
        "cut": data[: len(data) * 3 // 4],
        "summary": data[:-100] + b"?" + data[-99:],
    }


@pytest.mark.parametrize("verb", VERBS, ids=lambda verb: verb[0])
def test_what_is_not_whole_ends_with_three(
    contents: dict[str, bytes], tmp_path: Path, verb: tuple[str, ...]
) -> None:
    # That all verbs end with 0 of a whole one is tested with each of them.
    some = (
        contents if verb in VERBS[:2] else {n: contents[n] for n in ("spoiled", "cut")}
    )
    for name, content in some.items():
        folder = tmp_path / name
        folder.mkdir()
        log = folder / "run.mcap"
        log.write_bytes(content)
        ended = call(verb[0], log, *(flag.format(folder=folder) for flag in verb[1:]))
        assert ended.exit_code == (0 if name == "whole" else 3), name


# A last file that has only begun ------------------------------------------------------


@pytest.fixture(scope="module")
def split(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The files of a run that is split at every key-frame."""
    log = tmp_path_factory.mktemp("split") / "run.mcap"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recorder_process, "split_of", lambda _: Split(1))
        recorded(path_run(keyframe_every=10), log)
    return {path.name: path.read_bytes() for path in part_paths(log).values()}


def cut_last(split: dict[str, bytes], folder: Path, size: int) -> Path:
    """Write the files of a run, the last one so short; return the first."""
    for name, content in split.items():
        end = size if name == max(split) else len(content)
        (folder / name).write_bytes(content[:end])
    return folder / min(split)


def check_goes_on(log: Path, before: Path) -> None:
    """A run goes on from its last file but one."""
    totals = Recording.open_file(before).totals or {}
    _, found = find_resume_point(log)
    assert (found.log, found.tick) == (str(before), int(totals["ticks"]))
    more = ("--out", log.with_name("new.mcap"), "--ticks", found.tick + 5)
    assert call("resume", log, *more).exit_code == 0


@pytest.mark.parametrize("size", [0, 10, 2000, 4096, "a chunk but for a byte"])
def test_a_last_file_that_has_only_begun_is_named_and_nothing_else_is_lost(
    split: dict[str, bytes], tmp_path: Path, size: int | str
) -> None:
    last = tmp_path / max(split)
    if isinstance(size, str):
        last.write_bytes(split[last.name])
        size = Recording.open_file(last).files[0].layout.chunks[0].stop_offset - 1
    log = cut_last(split, tmp_path, size)
    line = f"{last}: begun, nothing in it"
    for name, *flags in VERBS:
        result = call(name, log, *(flag.format(folder=tmp_path) for flag in flags))
        assert result.exit_code == 3, (name, result.output)
        assert line.replace(" ", "") in flat(result.output).replace(" ", ""), name
    assert RunView(log).recording.unread == (line,)
    assert call("verify", tmp_path / "good.mcap").exit_code == 3
    check_goes_on(log, tmp_path / sorted(split)[-2])
    growing = Recording.open(log, verify=False)
    assert growing.grow() == (False, False)
    last.write_bytes(split[last.name])
    assert growing.grow() == (True, False)
    assert (growing.unread, growing.files[-1].path) == ((), last)


def test_what_is_in_a_last_file_is_read_although_no_run_goes_on_from_it(
    split: dict[str, bytes], tmp_path: Path
) -> None:
    """It has its key-frame, and was cut before it said where the senders begin."""
    last = tmp_path / max(split)
    last.write_bytes(split[last.name])
    whole = Recording.open_file(last).files[0]
    chunk, count = whole.layout.chunks[0], len(list(whole.messages()))
    log = cut_last(split, tmp_path, chunk.stop_offset)
    assert 0 < len(list(Recording.open_file(last).messages())) <= count
    for name, *flags in VERBS[1:]:  # `info` is of the first file alone
        result = call(name, log, *(flag.format(folder=tmp_path) for flag in flags))
        assert result.exit_code == 3, (name, result.output)
    check_goes_on(log, tmp_path / sorted(split)[-2])
