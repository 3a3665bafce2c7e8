r"""Names as LaTeX sets them, letter by letter, with any engine.

pdfLaTeX knows only some letters beyond ASCII. Those that a name may well have are set
by a command; of all others it sets the number, and LuaLaTeX and XeLaTeX the letter.
"""

import re

PREAMBLE = r"""\usepackage{iftex}
\ifPDFTeX
  \usepackage[T1]{fontenc}
  \usepackage{textcomp}
  \IfFileExists{lmodern.sty}{\usepackage{lmodern}}{}
\fi
% A letter that pdfLaTeX may not know, by its number.
\providecommand{\letterof}[2]{\ifPDFTeX\texttt{U+#1}\else#2\fi}
"""
"""What the commands of `escaped` need, after the document class."""

_SIGNS = {
    "α": "alpha",
    "β": "beta",
    "γ": "gamma",
    "δ": "delta",
    "ε": "epsilon",
    "ζ": "zeta",
    "η": "eta",
    "θ": "theta",
    "λ": "lambda",
    "μ": "mu",
    "π": "pi",
    "ρ": "rho",
    "σ": "sigma",
    "τ": "tau",
    "φ": "phi",
    "ω": "omega",
    "Δ": "Delta",
    "Σ": "Sigma",
    "Ω": "Omega",
    "∅": "emptyset",
    "∧": "wedge",
    "∨": "vee",
    "¬": "neg",
    "≤": "leq",
    "≥": "geq",
    "≠": "neq",
    "≡": "equiv",
    "→": "rightarrow",
    "×": "times",
    "…": "dots",
    "·": "cdot",
}
_ASCII = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "'": r"\textquotesingle{}",
    "`": r"\textasciigrave{}",
    # Nothing, so that two do not become one longer sign; braces do not do in LuaTeX.
    "-": r"-\/",
    ",": r",\/",
}
_LATIN = re.compile("[À-ÖØ-öø-ÿ]")
"""Letters that every engine knows."""

_NARROW, _NUMBER = 0.6, 3.6  # in ems: a letter; a number in place of one


def escaped(text: str) -> str:
    r"""Return a text as LaTeX that sets just that text.

    Example:
        >>> print(escaped("50 % of_a"))
        50 \% of\_a
    """
    letters = []
    for place, letter in enumerate(text):
        if letter in _ASCII:
            letters.append(_ASCII[letter])
        elif letter in _SIGNS:
            letters.append(rf"\ensuremath{{\{_SIGNS[letter]}}}")
        elif letter == " " and text[place - 1 : place] in ("", " "):
            letters.append(r"\ ")  # TeX takes two for one
        elif " " <= letter <= "~" or _LATIN.match(letter):
            letters.append(letter)
        else:
            letters.append(rf"\letterof{{{ord(letter):04X}}}{{{letter}}}")
    return "".join(letters)


def width(text: str, size: float) -> float:
    """Return how wide a text is at most in a usual font, in inches.

    Args:
        text: Not escaped.
        size: Of the font, in points.
    """
    ems = sum(
        _NARROW
        if letter <= "~" or letter in _SIGNS or _LATIN.match(letter)
        else _NUMBER
        for letter in text
    )
    return ems * size / 72.27


def comment(text: str) -> str:
    """Return a text as one line of a comment."""
    return "% " + "".join(c if c.isprintable() else " " for c in text)
