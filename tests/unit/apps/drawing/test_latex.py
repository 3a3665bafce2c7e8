r"""Names in LaTeX: what is read back is what was written, and nothing is a command."""

import re

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from neurosnap.apps.drawing.latex import _SIGNS, PREAMBLE, comment, escaped, width

_BACK = {
    r"\textbackslash{}": "\\",
    r"\textasciicircum{}": "^",
    r"\textasciitilde{}": "~",
    r"\textless{}": "<",
    r"\textgreater{}": ">",
    r"\textbar{}": "|",
    r"\textquotedbl{}": '"',
    r"\textquotesingle{}": "'",
    r"\textasciigrave{}": "`",
    r"-\/": "-",
    r",\/": ",",
    r"\ ": " ",
    **{rf"\{letter}": letter for letter in "{}$&#%_"},
    **{rf"\ensuremath{{\{name}}}": letter for letter, name in _SIGNS.items()},
}
_LETTER = re.compile(r"\\letterof\{([0-9A-F]{4,6})\}\{(.)\}", re.DOTALL)
_PLAIN = re.compile(r"[A-Za-z0-9 !()*+./:;=?@\[\]À-ÖØ-öø-ÿ]")


def read(latex: str) -> str:
    """Return what LaTeX sets; fail at anything that it would take for a command."""
    text, place = [], 0
    while place < len(latex):
        rest = latex[place:]
        known = next((form for form in _BACK if rest.startswith(form)), None)
        letter = _LETTER.match(rest)
        if known is not None:
            text.append(_BACK[known])
            place += len(known)
        elif letter is not None:
            assert int(letter[1], 16) == ord(letter[2])
            text.append(letter[2])
            place += letter.end()
        else:
            assert _PLAIN.match(rest), rest[:20]
            assert not (rest[0] == " " and text[-1:] == [" "])  # TeX would drop it
            text.append(rest[0])
            place += 1
    return "".join(text)


@given(st.text(st.characters(exclude_categories=["Cs", "Cc"])))
@example(r"\input{/etc/passwd} $x$ 100 % a_b^c ~d & #1 {e} <f> |g| --- ,, `` '' \"")
@example("  two  spaces  ")
@example("(fwd∧a₁*)  …  日本 Ærø ß 🚪")
def test_a_name_is_set_as_it_is(text: str) -> None:
    assert read(escaped(text)) == text
    assert width(text, 9) >= 0.07 * len(text)


@pytest.mark.parametrize("letters", ["--", ",,", "''", "``", "<<", ">>", "?`", "!`"])
def test_no_two_signs_become_one(letters: str) -> None:
    assert letters not in escaped(letters)
    assert not re.search(r"(-|,)[{}]*(-|,)", escaped(letters))


def test_every_command_is_known_to_every_engine_or_defined() -> None:
    assert r"\providecommand{\letterof}[2]" in PREAMBLE
    assert PREAMBLE.count(r"\ifPDFTeX") == PREAMBLE.count(r"\fi") == 2
    names = "|".join(_SIGNS.values())
    # All of plain TeX's mathematics; "ensuremath" and the rest of LaTeX's kernel.
    plain = (
        "alpha beta gamma delta epsilon zeta eta theta lambda mu pi rho sigma tau phi"
        " omega Delta Sigma Omega emptyset wedge vee neg leq geq neq equiv rightarrow"
        " times dots cdot"
    )
    assert names == "|".join(plain.split(" "))


def test_a_comment_is_one_line() -> None:
    assert comment("a\nb\r\\end{x}\x0bc\u2028d") == "% a b \\end{x} c d"
