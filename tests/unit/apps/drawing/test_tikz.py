r"""The TikZ of a model: read by a strict grammar, and compiled where TeX is there.

What the grammar does not know fails, so that the structure is all there is: a preamble
of known lines, and statements that end, with colours and styles defined before.
"""

import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from neurosnap.apps.drawing.dual_view import View
from neurosnap.apps.drawing.find_model import find, listed
from neurosnap.apps.drawing.latex import PREAMBLE, escaped
from neurosnap.apps.drawing.measures import measure
from neurosnap.apps.drawing.model import Model
from neurosnap.apps.drawing.page import draw_model
from neurosnap.apps.drawing.tikz import tikz
from neurosnap.poc.order.pocset import PocSet

HOSTILE = (
    r"\end{document}",
    "50% of $x$_{1}^2",
    "a & b # ~c~",
    "日本 🚪 {{",
    "-- ``q'' <<z>> ,,",
    "(fwd∧a₁)*)",
    "]; [x",
)
MODELS = [*listed(), "a :", "a, b, c : a = b*, c < a", "x, y : x <= x*"]

_COLOUR = r"\\definecolor\{(poc[a-z]+\d*)\}\{HTML\}\{[0-9A-F]{6}\}"
_NUMBER = r"-?\d+\.\d{3}"
_POINT = rf"\({_NUMBER},{_NUMBER}\)"
_WAY = rf"{_POINT}(?: -- {_POINT})+"
_OPTIONS = r"\[([^][{}\\]+)\]"
_STATEMENTS = [
    re.compile(rf"\\draw{_OPTIONS} {_WAY};"),
    re.compile(rf"\\fill{_OPTIONS} {_WAY} -- cycle;"),
    re.compile(rf"\\draw{_OPTIONS} {_POINT} circle\[radius=0\.\d+\];"),
    re.compile(rf"\\node{_OPTIONS} at {_POINT} \{{(.*)\}};"),
]
_OPTION = re.compile(
    r"poc [a-z]+|(?:draw|fill|text)=(?:white|poc[a-z]+\d*)|opacity=0\.\d+"
    r"|(?:line width|minimum width)=\d+(?:\.\d+)?(?:pt|in)|line cap=round"
    r"|anchor=(?:west|east|center)"
)


def drawn(text: str) -> str:
    model = find(text)
    return tikz(model, measure(model))


def hostile() -> Model:
    poc = PocSet.parse("a, b, c, d, e, f, g : a < b, c < d*, e < f").renamed(HOSTILE)
    return Model("hostile", "a title\n\\end{document}\r%", poc)


def nodes(latex: str, style: str) -> list[tuple[str, tuple[float, float]]]:
    """Return the texts and places of the nodes of a style."""
    found = re.findall(
        rf"\\node\[{style}[^]]*\] at \(({_NUMBER}),({_NUMBER})\) \{{(.*)\}};", latex
    )
    return [(text, (float(x), float(y))) for x, y, text in found]


def check(latex: str) -> None:
    """Fail unless a file is made of what is known, in order, and of nothing else."""
    head, _, rest = latex.partition("\\documentclass[tikz,border=4pt]{standalone}\n")
    assert all(line.startswith("% ") for line in head.splitlines())
    assert rest.startswith(PREAMBLE)
    preamble, _, body = rest.removeprefix(PREAMBLE).partition("\\begin{document}\n")
    colours, _, styles = preamble.partition("\\tikzset{\n")
    defined = {"white"}
    for line in colours.splitlines():
        made = re.fullmatch(_COLOUR, line)
        assert made, line
        assert made[1] not in defined
        defined.add(made[1])
    balanced(styles, depth=1)
    known = re.findall(r"^  ([a-z ]+)/\.style=", styles, re.MULTILINE)
    assert all(name.startswith("poc ") for name in known)  # TikZ has keys of its own
    assert set(re.findall(r"=(poc\w+)", styles)) <= defined
    for used in re.findall(r"[{ ](poc [a-z]+)[,}]", styles):
        assert used in known
    first, *lines, last, end = body.splitlines()
    assert first == r"\begin{tikzpicture}[x=1in,y=1in]"
    assert (last, end) == (r"\end{tikzpicture}", r"\end{document}")
    scopes = 0
    for line in lines:
        if line.startswith("% "):
            continue
        if re.fullmatch(rf"\\begin\{{scope\}}\[shift=\{{{_POINT}\}}\]", line):
            scopes += 1
        elif line == r"\end{scope}":
            scopes -= 1
            assert scopes == 0
        else:
            matches = [each.fullmatch(line) for each in _STATEMENTS]
            (match,) = [each for each in matches if each]
            for option in match[1].split(", "):
                assert _OPTION.fullmatch(option), option
                name = option.split("=")[-1]
                assert not option.startswith("poc ") or option in known, option
                assert not name.startswith("poc") or name in {*known, *defined}
            if match.lastindex == 2:
                balanced(match[2])
                commands = re.findall(r"\\([A-Za-z]+|.)", match[2])
                assert not {"end", "begin", "input", "write", "\\"} & set(commands)
    assert scopes == 0


def balanced(text: str, depth: int = 0) -> None:
    for brace in re.findall(r"(?<!\\)[{}]", text):
        depth += 1 if brace == "{" else -1
        assert depth >= 0
    assert depth == 0


@pytest.mark.parametrize("text", MODELS)
def test_it_is_made_of_known_statements(text: str) -> None:
    check(drawn(text))


def test_what_is_no_statement_is_found() -> None:
    good = drawn("simple")
    for bad in (
        good.replace(";", "", 1),
        good.replace("{pocring}", "{other}"),
        good.replace(r"\end{scope}", ""),
        good.replace("{a}", "{$a}", 1).replace(" at (", " at ", 1),
        good.replace("poc name/", "name/"),
        good.replace("{a}", "{a{}", 1),
        good.replace("draw=pocelement0", "draw=pocelement9"),
    ):
        assert bad != good
        with pytest.raises((AssertionError, ValueError)):
            check(bad)


@pytest.mark.parametrize("text", MODELS)
def test_it_has_every_literal_once_and_every_vertex_and_edge(text: str) -> None:
    model, latex = find(text), drawn(text)
    boxes = nodes(latex, "poc (?:literal|nowhere)")
    assert len(boxes) == model.elements
    assert latex.count("[poc cover]") == len(model.poc.hasse())
    assert model.vertices is not None
    view = View.of(model.poc, model.vertices, level=model.level, seen=model.witnessed)
    seen = [place for _, place in nodes(latex, "poc shown")]
    hidden = [place for _, place in nodes(latex, "poc hidden")]
    witnessed = view.corners if model.witnessed is None else model.witnessed
    assert (len(seen), len(seen) + len(hidden)) == (len(witnessed), len(view.corners))
    assert len(set(seen + hidden)) == len(view.corners)
    edges = re.findall(
        rf"\\draw\[draw=pocelement(\d+),[^]]*\] \(({_NUMBER}),({_NUMBER})\)"
        rf" -- \(({_NUMBER}),({_NUMBER})\);",
        latex,
    )
    assert sorted(int(edge[0]) for edge in edges) == sorted(view.crossed.tolist())
    for number, *ends in edges:
        way = np.array(ends, float)[2:] - np.array(ends, float)[:2]
        along = view.layout.directions[int(number)]
        assert abs(way[0] * along[1] - way[1] * along[0]) < 0.01  # parallel
    assert latex.count(r"\fill[poc tile") == len(view.squares)


def test_boxes_stand_above_what_they_are_implied_by() -> None:
    places = dict(nodes(drawn("a, b, c : a < b < c"), "poc literal"))
    assert places["a"][1] < places["b"][1] < places["c"][1]
    assert places["c*"][1] < places["b*"][1] < places["a*"][1]


def test_marks_and_the_state_are_there() -> None:
    grid = drawn("grid")
    assert {text for text, _ in nodes(grid, "poc mark")} == {"u", "v", "w", "m"}
    assert drawn("six-arcs").count("draw=pocpuncture") == 2
    assert drawn("beacons").count("circle[radius=0.115]") == 1
    assert drawn("bad-dual").count("draw=pocring, line width=10pt") == 2


def test_hostile_names_are_set_as_they_are() -> None:
    model = hostile()
    latex = tikz(model, measure(model))
    check(latex)
    texts = {text for text, _ in nodes(latex, "poc literal")}
    assert texts == {escaped(name + star) for name in HOSTILE for star in ("", "*")}
    code = [line for line in latex.splitlines() if not line.startswith("%")]
    assert sum(line.count(r"\end{document}") for line in code) == 1


def test_a_state_is_lit() -> None:
    model = find("a, b : a < b")
    state = np.array([True, False, True, False])
    latex = tikz(replace(model, state=state), measure(model))
    check(latex)
    boxes = dict(nodes(latex, "poc literal"))
    lit = [place for _, place in nodes(latex, "poc lit,")]
    assert lit == [boxes["a"], boxes["b"]]
    assert len(nodes(latex, "poc possible")) == 1


@pytest.mark.slow
def test_it_is_written_without_matplotlib_the_same_each_time(tmp_path: Path) -> None:
    script = """
import sys
sys.modules["matplotlib"] = None
sys.argv = ["neurosnap", "model", "six-wide-arcs", "--out", sys.argv[1]]
from neurosnap.__main__ import main
main()
"""
    files = [tmp_path / "one.tex", tmp_path / "two.tex"]
    for seed, path in enumerate(files):
        subprocess.run(
            [sys.executable, "-c", script, str(path)],
            env={"PYTHONHASHSEED": str(seed)},
            check=True,
            capture_output=True,
        )
    one, two = (path.read_text() for path in files)
    assert one == two == drawn("six-wide-arcs")


def has_tex() -> bool:
    """Return whether LaTeX is here, with the class that the files are of."""
    if shutil.which("pdflatex") is None or shutil.which("kpsewhich") is None:
        return False
    found = subprocess.run(["kpsewhich", "standalone.cls"], capture_output=True)
    return found.returncode == 0


@pytest.mark.slow
@pytest.mark.skipif(not has_tex(), reason="no LaTeX here: texlive-latex-extra has it")
@pytest.mark.parametrize("text", [*MODELS, "hostile"])
def test_it_compiles(tmp_path: Path, text: str) -> None:
    model = hostile() if text == "hostile" else find(text)
    draw_model(model, measure(model), tmp_path / "a.tex")
    done = subprocess.run(
        ["pdflatex", "-halt-on-error", "-no-shell-escape", "a.tex"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    assert done.returncode == 0, done.stdout[-2000:]
    assert "Overfull" not in done.stdout
    assert "Missing character" not in (tmp_path / "a.log").read_text(errors="replace")
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
