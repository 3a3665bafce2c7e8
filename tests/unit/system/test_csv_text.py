"""Exported names read back unchanged, and are never run as formulas."""

import csv
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.apps.export.table import Column, write_csv
from neurosnap.errors import InvalidValueError
from neurosnap.sensorium import visible
from neurosnap.sources.csv_cells_and_formulas import as_text, as_written
from neurosnap.sources.open import open_source

EVIL = "=cmd|'/c calc'!A1"
TEXTS = st.text(st.sampled_from("'=+-@＝\t\r\nab"), max_size=6) | st.text()


@given(TEXTS)
def test_every_text_is_read_as_it_was_and_none_is_a_formula(text: str) -> None:
    assert as_written(as_text(text)) == text
    if len(text) > 1:  # a lone sign is no formula
        assert as_text(text).lstrip("\t\r\n")[:1] not in set("=+-@＝＋－＠")


@pytest.mark.parametrize("name", ["door", "a=b", "it's", "'tis", "-", "below_4*"])
def test_what_is_no_formula_stays_as_it_is(name: str) -> None:
    assert as_text(name) == name == as_written(name)


def test_an_export_holds_no_formula_and_gives_the_names_back(tmp_path: Path) -> None:
    names = (EVIL, "-x", "+5V", "@home", "'=x", "door")
    path = tmp_path / "out.csv"
    columns = [Column(name, "bit") for name in names]
    write_csv(path, columns, [[True for _ in names]])
    with path.open(encoding="utf-8", newline="") as file:
        header = next(csv.reader(file))
    assert not any(cell[0] in "=+-@" for cell in header)
    assert open_source(str(path), 0).sensors == names


def test_what_a_decision_says_is_no_formula(tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    write_csv(path, [Column("decision", "text"), Column("why", "text")], [["-", EVIL]])
    assert path.read_text(encoding="utf-8").splitlines()[1] == f"-,'{EVIL}"


# Letters that do not show -------------------------------------------------------------


@pytest.mark.parametrize("letter", ["\u202e", "\u2066", "\u200b", "\ufeff", "\xad"])
def test_a_name_with_a_letter_that_hides_is_refused(
    tmp_path: Path, letter: str
) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"door,mo{letter}tion\n0,1\n", encoding="utf-8")
    rule = r"^name: must have no letters that hide, or turn the text around, got '"
    with pytest.raises(InvalidValueError, match=rule) as caught:
        open_source(str(path), 0)
    assert letter not in str(caught.value)


def test_a_letter_that_joins_others_is_part_of_a_name(tmp_path: Path) -> None:
    persian = "نمی\u200cدانم"
    path = tmp_path / "a.csv"
    path.write_text(f"door,{persian}\n0,1\n", encoding="utf-8")
    source = open_source(str(path), 0)
    assert source.sensors == ("door", persian)
    assert visible(persian) == persian
