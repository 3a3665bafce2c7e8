"""Each service of a swarm can be stopped in the midst of a run."""

import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from neurosnap.recording.replay.verify import verify
from tests.support.exhaustive import rows
from tests.support.patience import PATIENCE
from tests.support.ports import free_port
from tests.support.services import ENDLESS, PATH, SWARM, begun, ended, going, hub_at

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]


@pytest.fixture
def endpoint() -> Iterator[str]:
    """A hub on loopback."""
    where = f"tcp/127.0.0.1:{free_port()}"
    with hub_at(where):
        yield where


VERBS = ("coordinate", "world", "join", "record")


@pytest.mark.parametrize("who", rows(["record"], ["coordinate", "world", "join"]))
def test_each_of_them_can_be_stopped_in_the_midst(
    who: str, endpoint: str, tmp_path: Path
) -> None:
    log = tmp_path / "log.mcap"
    at = ("--connect", endpoint)
    stay = ("--restart", "never")
    lines: dict[str, tuple[object, ...]] = {
        "coordinate": (PATH, "--swarm", SWARM, *ENDLESS, "--deadline", 1),
        "world": (SWARM, PATH, *stay),
        "join": (SWARM, "--cells", "0-5", *stay),
        "record": (SWARM, "--out", log, *stay),
    }
    with ExitStack() as stack:
        parts = {
            verb: stack.enter_context(going(verb, *line, *at))
            for verb, line in lines.items()
        }
        begun(endpoint, 5)
        parts[who].send_signal(signal.SIGINT)
        # Whoever stops the coordinator or the world ends the run in order; who takes
        # cells or the recorder away makes it fail.
        in_order = who in ("coordinate", "world")
        said = ended(parts["coordinate"], 0 if in_order else 1)
        codes = {verb: parts[verb] for verb in VERBS if verb != "coordinate"}
        for verb, part in codes.items():
            part.communicate(timeout=PATIENCE)
            if verb != "record":
                assert part.returncode == 0
    if who == "record":
        assert "recorder: must stay until the run ends, is gone" in said
        assert parts["record"].returncode == 3
        assert not verify(log).complete
    if in_order:
        assert parts["record"].returncode == 0
        verdict = verify(log)
        assert (verdict.same, verdict.complete) == (True, True)
    assert verify(log).ticks >= 4
