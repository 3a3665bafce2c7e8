"""Hostile input: a short run of each target, and what the long runs have found."""

import itertools
import random
from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.protocol.cell_and_worker_base import check_readings
from neurosnap.runtime.parts.job import decoded
from tests.support.exhaustive import rows
from tests.support.memory_hubs import run_out
from tests.support.refusals import refusal
from tools.fuzz import __main__ as fuzz
from tools.fuzz import altered_bytes
from tools.fuzz.messages import altered
from tools.fuzz.run import honest_run
from tools.fuzz.targets import Count, FuzzError, Twins

DISK = {"bag", "disk", "recording"}
"""Targets that write files."""

# The fuzzer ---------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    "target", rows(sorted(fuzz.TARGETS.keys() - DISK), sorted(DISK))
)
def test_no_input_does_harm(target: str) -> None:
    inputs = {"recording": 150, "disk": 12, "bag": 150}.get(target, 1500)
    (count,) = fuzz.fuzz([target], inputs, 7, 1.0, None).values()
    assert count.inputs >= inputs
    assert count.rejected < count.inputs
    assert count.rejected or target == "disk"  # of few files something can be read


@pytest.mark.slow
def test_a_round_can_be_made_again(tmp_path: Path) -> None:
    drawn: list[list[bytes]] = []
    for folder in (tmp_path / "first", tmp_path / "again"):
        folder.mkdir()
        honest, chance = honest_run(folder), random.Random("1/recording/3")
        drawn.append(
            [altered_bytes.damage_recording(honest.recording, chance) for _ in "abc"]
        )
    assert drawn[0] == drawn[1]


def test_a_failure_says_how_to_make_it_again() -> None:
    expected = (
        r"(?s)^broken: ZeroDivisionError: .*"
        r"\nagain: --seed 5 --only broken --round 2\ninput: 'the input'$"
    )
    numbers = itertools.count()

    def in_the_third_round(_: random.Random, count: Count) -> None:
        count.timed("the input", lambda: 1 // (2 - next(numbers)))

    with pytest.raises(FuzzError, match=expected):
        for _ in fuzz.rounds("broken", in_the_third_round, 5):
            pass


class Parrot:
    """Says how much it has heard, and calls everything a fault."""

    def __init__(self) -> None:
        self._heard = 0

    def receive(self, given: wire.Message) -> list[wire.Message]:
        self._heard += 1
        return [wire.Fault("parrot", f"{self._heard} of {type(given).__name__}")]


def test_a_core_that_is_changed_by_what_it_rejects_is_found_out() -> None:
    twins = Twins(Parrot(), [wire.Leave("a")] * 50)
    with pytest.raises(FuzzError, match=r"^said .*Leave.* and not .*Leave"):
        twins.play(random.Random(1), Count(), 4)


# What every part does -----------------------------------------------------------------


def test_a_fault_does_not_repeat_ten_megabytes() -> None:
    hub = MemoryHub()
    part, heard = hub.fabric("cell/1"), list[wire.Delivery]()
    hub.fabric("ear").listen(("fault/**",), heard.extend)
    large = b'{"type":"' + b"x" * 10_000_000 + b'"}'
    assert decoded(part, [wire.Delivery("wavestart", 0, 0, large)]) == []
    run_out(hub)
    (delivery,) = heard
    assert len(delivery.payload) < 500
    fault = wire.decode("fault/cell/1", delivery.payload)
    assert isinstance(fault, wire.Fault)
    assert fault.what.startswith(
        "wavestart: must hold a message, got Invalid value 'xxx"
    )


def test_partial_observations_that_may_be_right_are_tried_and_others_too() -> None:
    chance, whole = random.Random(0), wire.Observation(3, b"\x5a\x03")
    tried = [altered(whole, chance) for _ in range(400)]
    partial = [one for one in tried if isinstance(one, wire.Observation) and one.known]
    right = sum(refusal(check_readings, one) is None for one in partial)
    assert 40 < right < len(partial) - 40
