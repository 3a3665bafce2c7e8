"""Picture files are reproducible and hold no timestamp."""

import subprocess
import sys

import pytest

pytest.importorskip("matplotlib")

from neurosnap.system.picture import KINDS, canvas_type, encoded

pytestmark = pytest.mark.slow

_DRAWS = """
import sys
from neurosnap.system.picture import canvas_type, encoded
figure = canvas_type("test")(figsize=(3, 2))
axes = figure.subplots()
axes.plot([1, 3, 2], "o-", label="one")
axes.fill_between([0, 1], [1, 2], hatch="//")
axes.legend()
sys.stdout.buffer.write(encoded(figure, sys.argv[1]))
"""


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.exhaustive
def test_a_picture_has_the_same_bytes_in_every_process(kind: str) -> None:
    """A clip path's name and a hatch's follow from a random number without a salt."""
    one, two = (
        subprocess.run(
            [sys.executable, "-c", _DRAWS, kind],
            env={"PYTHONHASHSEED": seed, "SOURCE_DATE_EPOCH": epoch},
            capture_output=True,
            check=True,
        ).stdout
        for seed, epoch in (("1", "1000000000"), ("2", "1100000000"))
    )
    begins = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
    assert one.startswith(begins[kind])
    assert one == two
    for dated in (b"dc:date", b"CreationDate", b"ModDate", b"2001-09", b"D:2001"):
        assert dated not in one


def test_a_vector_has_text_as_print_wants_it() -> None:
    figure = canvas_type("test")(figsize=(2, 1))
    figure.text(0.1, 0.5, "door \N{SUBSET OF} 扉")  # the font has no such glyph
    assert b"<text" not in encoded(figure, "svg")
    pdf = encoded(figure, "pdf")
    assert b"/Type3" not in pdf
    assert b"/FontFile2" in pdf
