"""`docs/paper.md` leads from every statement of the paper to code and tests that exist.

The labels and titles of the paper are in ``support/paper_labels.csv``, in its order. A
statement without a label is cited by its title.
"""

import ast
import csv
import functools
import importlib
import re
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
STATEMENTS = {"defn", "prop", "lemma", "thm", "cor", "alg"}

with (ROOT / "tests/support/paper_labels.csv").open(newline="") as file:
    LISTED = list(csv.DictReader(file))
KINDS = {row["label"]: row["kind"] for row in LISTED if row["label"]}
TITLES = [row["title"] for row in LISTED if row["title"]]


class Row(NamedTuple):
    """What the index says of a statement, or of some that are one definition."""

    labels: list[str]
    title: str
    states: str
    code: list[str]
    tests: list[str]
    excuses: list[str]  # what the cells of code and of tests say instead of a name


def index() -> list[Row]:
    found = []
    for line in (ROOT / "docs/paper.md").read_text().splitlines():
        if line.startswith("|") and not line.startswith(("| Label", "| Title", "| --")):
            name, states, code, tests = line.strip("| ").split(" | ")
            found.append(
                Row(
                    re.findall(r"`([^`]+)`", name),
                    name.strip('"') if name.startswith('"') else "",
                    states,
                    re.findall(r"`([^`]+)`", code),
                    re.findall(r"`([^`]+)`", tests),
                    [cell for cell in (code, tests) if "`" not in cell],
                )
            )
    return found


INDEX = index()
LABEL = rf"(?:{'|'.join(map(re.escape, sorted(KINDS, key=len, reverse=True)))})(?!\w)"
MARK = re.compile(r"\[GK\] ")
# A label, a title, one of the four settings, or something next to a label.
CITATION = re.compile(
    rf"(?:(?:the [a-z ]+ )?(?:before|after|of) )?(?P<label>{LABEL})"
    r'|(?:(?:defn|prop|lemma|thm|cor) )?"(?P<title>[^"]+)"'
    r"|settings? \([a-d]\)"
    r"|Guralnik and Koditschek,|in comments and here is|in docstrings is"
)
# Whatever looks like a label is one, also where the paper is not named again.
LIKE_A_LABEL = re.compile(
    r"(?<![\w./-])(?:defn|prop|lemma|thm|cor|alg|eqn|fig|example|section|subsection"
    r"|empirical|discounted|discussion|appendix|proofs):(?=[A-Za-z])"
)
LIKE_A_TITLE = re.compile(r'(?<!\w)(?:defn|prop|lemma|thm|cor)\.? "([^"]+)"')
ABBREVIATED = re.compile(r"(?<!\w)(?:defn|prop|lemma|thm|cor|alg|eqn?)\. \w+")


@functools.cache
def texts() -> dict[str, str]:
    """Return the files that may cite the paper, each as one line, but for this one."""
    found = {}
    for folder in ("neurosnap", "world", "tests", "tools", "docs"):
        for path in sorted((ROOT / folder).rglob("*")):
            name = path.relative_to(ROOT)
            own = "vendor" not in name.parts and path.name != Path(__file__).name
            if own and path.suffix in {".py", ".js", ".md"}:
                text = path.read_text()
                found[str(name)] = re.sub(r"\s*\n\s*(?:#|//|\*)?\s*", " ", text)
    return found


def near(text: str, start: int) -> str:
    return text[start : start + 60]


def unknown(text: str) -> list[str]:
    """Return what a text cites and the paper has not."""
    found = []
    for mark in MARK.finditer(text):
        cited = CITATION.match(text, mark.end())
        title = cited and cited["title"]
        if not cited or (title and not any(title in known for known in TITLES)):
            found.append(near(text, mark.start()))
    for like in LIKE_A_LABEL.finditer(text):
        if not re.compile(LABEL).match(text, like.start()):
            found.append(near(text, like.start()))
    for title in LIKE_A_TITLE.finditer(text):
        if not any(title[1] in known for known in TITLES):
            found.append(near(text, title.start()))
    found += [near(text, short.start()) for short in ABBREVIATED.finditer(text)]
    return found


@functools.cache
def names_of(path: str) -> set[str]:
    """Return the tests of a file, those of a class after its name."""
    found = set()
    for node in ast.parse((ROOT / path).read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            found.add(node.name)
        elif isinstance(node, ast.ClassDef):
            found |= {
                f"{node.name}::{each.name}"
                for each in node.body
                if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef)
            }
    return found


def resolved(path: str) -> object:
    """Return what a dotted path names, in the module that its longest part names."""
    parts = path.split(".")
    for length in range(len(parts), 0, -1):
        name = ".".join(parts[:length])
        try:
            thing: object = importlib.import_module(name)
        except ModuleNotFoundError as missing:
            if not f"{name}.".startswith(f"{missing.name}."):
                raise  # not the one that was asked for, nor a folder of it
            continue
        for part in parts[length:]:
            thing = getattr(thing, part)
        return thing
    raise AssertionError(path)


def test_every_statement_with_a_label_has_one_row() -> None:
    labels = [label for row in INDEX for label in row.labels]
    wanted = {label for label, kind in KINDS.items() if kind in STATEMENTS}
    assert len(wanted) == 54
    assert len(labels) == len(set(labels))
    assert wanted <= set(labels)
    assert {KINDS[label] for label in set(labels) - wanted} <= {"eqn"}


def test_every_statement_with_a_title_alone_has_one_row() -> None:
    wanted = [
        row["title"] for row in LISTED if row["kind"] in STATEMENTS and not row["label"]
    ]
    assert sorted(row.title for row in INDEX if row.title) == sorted(wanted)


def test_every_equation_that_is_cited_has_a_row() -> None:
    rows = {label for row in INDEX for label in row.labels}
    cited = {
        found[0]
        for name, text in texts().items()
        if name != "docs/paper.md"
        for found in re.finditer(LABEL, text)
        if KINDS[found[0]] == "eqn" and found[0].startswith("eqn:")
    }
    assert "eqn:virtual implication" in cited
    assert cited == {label for label in rows if KINDS[label] == "eqn"}


def test_every_row_says_what_it_states_and_excuses_itself_briefly() -> None:
    for row in INDEX:
        assert bool(row.labels) != bool(row.title), row
        assert row.states.endswith("."), row
        assert all(0 < len(said.split()) <= 5 for said in row.excuses), row
        assert row.code or row.tests, row


def test_code_in_the_index_exists() -> None:
    for path in {path for row in INDEX for path in row.code}:
        assert path.split(".")[0] in {"neurosnap", "tests", "tools", "world"}, path
        assert resolved(path) is not None, path


def test_tests_in_the_index_exist() -> None:
    for test in {test for row in INDEX for test in row.tests}:
        path, _, name = test.partition("::")
        assert name.split("::")[-1].startswith("test_"), test
        assert name in names_of(path), test


def test_citations_are_looked_at() -> None:
    assert len(texts()) > 300
    assert sum(len(MARK.findall(text)) for text in texts().values()) > 100


def test_what_is_cited_is_in_the_paper() -> None:
    found = {name: unknown(text) for name, text in texts().items()}
    assert {name: cited for name, cited in found.items() if cited} == {}


def test_a_citation_of_what_is_not_there_is_found() -> None:
    assert unknown("[GK] defn:dual.") == []
    for cited in ("defn:duality", '"Closing the Door"', "eq. context", "coherent set"):
        assert unknown(f"[GK] {cited}")
