"""The parts of a run are started here, or by a starter that is found by its name."""

from importlib import metadata

import pytest

from neurosnap.errors import InvalidValueError, MissingExtraError
from neurosnap.protocol.run_options import CellKind
from neurosnap.runtime.child_processes import ChildProcesses
from neurosnap.runtime.network import PRIVATE, Network
from neurosnap.runtime.request import HERE, STARTERS, Placement


class Elsewhere(ChildProcesses):
    """A starter of another package."""

    def __init__(self, address: str, network: Network, *, again: bool) -> None:
        super().__init__()
        self.given = address, network, again

    @staticmethod
    def check(cells: CellKind) -> None:
        if cells != "worker":
            raise InvalidValueError("kind", "must be 'worker'", cells)


@pytest.fixture(autouse=True)
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    entries = metadata.EntryPoints(
        metadata.EntryPoint(name, value, STARTERS)
        for name, value in (
            ("elsewhere", f"{__name__}:Elsewhere"),
            ("gone", "no_such_package:Starter"),
        )
    )
    monkeypatch.setattr(metadata, "entry_points", entries.select)


def test_a_starter_is_found_by_its_name() -> None:
    assert type(HERE.starter(PRIVATE, again=False)) is ChildProcesses
    placement = Placement(place="elsewhere", address="HOST:1")
    placement.check("worker")
    starter = placement.starter(PRIVATE, again=True)
    assert isinstance(starter, Elsewhere)
    assert starter.given == ("HOST:1", PRIVATE, True)


@pytest.mark.parametrize(
    ("placement", "rule"),
    [
        (Placement(place="elsewhere"), r"^kind: must be 'worker', got 'process'"),
        (Placement(place="moon"), r"^place: must be one of here, elsewhere, gone, got"),
        (Placement(address="HOST:1"), "^address: must come with the name of a starter"),
    ],
)
def test_what_cannot_be_placed_is_refused(placement: Placement, rule: str) -> None:
    with pytest.raises(InvalidValueError, match=rule):
        placement.check("process")


def test_a_starter_names_the_package_that_it_lacks() -> None:
    rule = r"^place: must have no_such_package installed \(run .*neurosnap-uma\[gone\]"
    with pytest.raises(MissingExtraError, match=rule):
        Placement(place="gone").check("worker")
