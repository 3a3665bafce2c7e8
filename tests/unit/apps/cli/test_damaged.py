"""The exit codes of verbs that read a damaged or truncated recording."""

from pathlib import Path

import pytest

from neurosnap.recording.read.recording import Recording
from tests.support.command_line import call
from tests.support.recorded_runs import in_chunks, path_run, recorded

pytestmark = pytest.mark.slow

VERBS = (
    ("info",),
    ("verify",),
    ("learn",),
    ("watch",),
    ("depth", "--out", "{folder}"),
    ("export", "--out", "{folder}/out.csv"),
    ("export", "--out", "{folder}/good.mcap"),
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    return in_chunks(
        recorded(path_run(), folder / "long.mcap"), folder / "whole.mcap", 12000
    )


def code(log: Path, folder: Path, verb: tuple[str, ...]) -> int:
    """Return how a verb ends."""
    name, *flags = verb
    given = [flag.format(folder=folder) for flag in flags]
    return call(name, log, *given).exit_code


@pytest.fixture(scope="module")
def contents(whole: Path) -> dict[str, bytes]:
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
        assert code(log, folder, verb) == (0 if name == "whole" else 3), name
