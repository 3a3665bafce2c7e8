"""Files of snapshots are reproducible; other files are refused."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.archive import pack_arrays, unpack_arrays
from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.sensorium import Sensorium

KINDS = pytest.mark.parametrize("kind", [EmpiricalSnapshot, DiscountedSnapshot])


def seasoned(kind: type[Snapshot]) -> Snapshot:
    snapshot = kind(Sensorium(["door", "Tür", "motion"]), 0.2)
    for bits in [(0, 0, 0), (0, 0, 1), (0, 1, 1), (1, 1, 1)] * 5:
        snapshot.observe(bits)
    return snapshot


@KINDS
@pytest.mark.parametrize("unknown", [False, True])
def test_a_file_gives_back_everything(
    kind: type[Snapshot], unknown: bool, tmp_path: Path
) -> None:
    snapshot, path = seasoned(kind), tmp_path / "memory.npz"
    if unknown:  # then there are squares of their own
        snapshot.observe([1, 0, 1], [True, False, True])
    path.write_bytes(snapshot.to_bytes())
    for twin in (
        kind.from_bytes(path.read_bytes()),
        Snapshot.from_bytes(path.read_bytes()),
    ):
        assert type(twin) is kind
        assert twin.sensorium == snapshot.sensorium
        assert (twin.threshold, twin.clock) == (snapshot.threshold, 20 + unknown)
        assert (twin.state == snapshot.state).all()
        assert (twin.poc_graph().edges == snapshot.poc_graph().edges).all()
        assert twin.weight(0, 3) == snapshot.weight(0, 3)
        assert twin.to_bytes() == snapshot.to_bytes()
    with np.load(path, allow_pickle=False) as file:  # numpy reads it, too
        assert file["names"].tolist() == ["door", "Tür", "motion"]


def test_another_kind_is_refused() -> None:
    data = EmpiricalSnapshot(2).to_bytes()
    rule = r"^data: must be a DiscountedSnapshot written .*kind: must be Discounted"
    with pytest.raises(InvalidValueError, match=rule):
        DiscountedSnapshot.from_bytes(data)


@pytest.mark.parametrize("cut", [0, 1, 100, -1])
def test_a_file_cut_short_is_refused(cut: int) -> None:
    data = seasoned(EmpiricalSnapshot).to_bytes()[:cut]
    with pytest.raises(InvalidValueError, match=r"^data: must be a Snapshot "):
        Snapshot.from_bytes(data)


WRONG: dict[type[Snapshot], list[tuple[str, NDArray[np.generic] | None, str]]] = {
    EmpiricalSnapshot: [
        ("schema", np.array(2), "schema: must be 1"),
        ("kind", np.array("Snapshot"), "kind: must be Snapshot"),
        ("kind", np.array("int"), "kind: must be Snapshot"),
        ("kind", np.array(3), "kind: must be <U0"),
        ("names", np.array(["a", "a", "b"]), "names: must be unique"),
        ("names", np.array(["a", "b"]), "(joints|twins|marginals): must be u?int32"),
        ("names", np.array([["a", "b", "c"]]), "names: must be <U0"),
        ("clock", np.array(-1), "clock: must be in"),
        ("clock", np.array(2**32), "clock: must be in"),
        ("clock", np.array(20.0), "clock: must be int64"),
        ("clock", np.array(3), "weights: must be consistent"),
        ("threshold", np.array(0.5), "threshold: must be in"),
        ("threshold", np.full((2, 2), 0.1), "threshold: must be float64"),
        ("marginals", np.full(3, 99, np.uint32), "weights: must be consistent"),
        ("joints", np.full(3, 99, np.uint32), "weights: must be consistent"),
        ("joints", np.zeros(3), "joints: must be uint32"),
        ("state", np.array([3], np.uint8), "state: must not hold a literal"),
        ("state", np.array([64], np.uint8), "packed bits: must be 0 beyond"),
        ("state", np.zeros(2, np.uint8), "state: must be uint8"),
        ("since", np.full(3, 21, np.uint32), "since: must not be after"),
        ("since", np.zeros(3), "since: must be uint32"),
        ("squares", np.zeros((4, 3)), "squares: must be uint32"),
        ("squares", np.zeros((3, 3), np.uint32), r"squares: must be uint32 \(4, 3\)"),
        ("squares", np.full((4, 3), 6, np.uint32), "weights: must be consistent"),
    ],
    DiscountedSnapshot: [
        ("decay", np.array(1.0), "decay: must be in"),
        ("codes", np.full(3, 5, np.uint8), "codes: must go with the weights"),
        ("codes", np.full(3, 12, np.uint8), "codes: must go with the weights"),
        ("codes", np.zeros(2, np.uint8), "codes: must be uint8"),
        ("marginals", np.full(3, 1.5), "weights: must be consistent"),
        ("joints", np.full(3, np.nan), "weights: must be consistent"),
        ("joints", np.full(3, -0.1), "weights: must be consistent"),
        ("squares", np.full((4, 3), np.nan), "weights: must be consistent"),
        ("squares", np.full((4, 3), 0.3), "weights: must be consistent"),
        ("squares", np.full((4, 3), 0.25), "codes: must go with the weights"),
        *(
            (key, None, f"{key}: must be there")
            for key in ("schema", "kind", "names", "codes", "state", "decay")
        ),
    ],
}


@pytest.mark.parametrize(
    ("kind", "key", "value", "rule"),
    [(kind, *row) for kind, rows in WRONG.items() for row in rows],
)
def test_arrays_that_make_no_sense_or_are_not_there_are_refused(
    kind: type[Snapshot], key: str, value: NDArray[np.generic] | None, rule: str
) -> None:
    arrays = unpack_arrays(seasoned(kind).to_bytes())
    if value is None:
        del arrays[key]
    else:
        arrays[key] = value
    with pytest.raises(InvalidValueError, match=rf"^data: must be a Snap.*({rule})"):
        Snapshot.from_bytes(pack_arrays(arrays))


def test_pickles_and_compressed_members_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="allow_pickle"):
        pack_arrays({"a": np.array([object()])})
    np.savez(tmp_path / "pickled.npz", names=np.array([{}], object))
    np.savez_compressed(tmp_path / "small.npz", names=np.zeros(1))
    for name in ("pickled", "small"):
        data = (tmp_path / f"{name}.npz").read_bytes()
        with pytest.raises(InvalidValueError, match=r"^data: must be a Snapshot "):
            Snapshot.from_bytes(data)
