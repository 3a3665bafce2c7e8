"""The README and docs/ are accurate: code blocks run, and named items exist."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import gymnasium
import pytest

import world
from tests.support.command_line import whole_command
from tests.support.commands import Command
from tests.support.patience import PATIENCE

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"
PAGES = [README, *sorted((ROOT / "docs").rglob("*.md"))]
LINKED = [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "SECURITY.md"]
FENCED = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
BELOW = re.compile(r"\n\n```text\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"(?<!`)`([^`]+)`(?!`)")
ASSIGNED = re.compile(r"([A-Z]+)=(\S+)")
OF_A_CHECKOUT = re.compile(
    r"^(from|import) (world|examples|tools|tests)\b", re.MULTILINE
)
"""Imports of what no wheel has, or has by another name."""
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
PROGRAM = whole_command()


def name_of(page: Path) -> str:
    """Return what a page is called in the tests: its path, without docs/."""
    return str(page.relative_to(ROOT).with_suffix("")).removeprefix("docs/")


def blocks(page: Path, language: str) -> list[str]:
    """Return the blocks of a page in a language."""
    return [text for kind, text in FENCED.findall(page.read_text()) if kind == language]


def commands(page: Path) -> list[str]:
    """Return the commands of a page that are to be run."""
    return [
        line.split("#")[0].strip()
        for text in blocks(page, "sh")
        for line in text.splitlines()
    ]


def shown(page: Path) -> dict[str, list[str]]:
    """Return what a page shows of the output of commands that are to be run."""
    return {
        command: output.splitlines()
        for text in blocks(page, "console")
        for command, output in re.findall(
            r"^\$ (.*)\n((?:[^$].*\n)+)", text, re.MULTILINE
        )
        if command in commands(page)
    }


def mentioned(page: Path) -> list[str]:
    """Return every command of ours that a page prints, to be run or not."""
    text = page.read_text()
    lines = [
        line.removeprefix("$ ").split("#")[0]
        for kind, block in FENCED.findall(text)
        if kind in ("sh", "console")
        for line in block.splitlines()
    ]
    lines += [" ".join(code.split()) for code in INLINE.findall(FENCED.sub("", text))]
    return [
        line for line in lines if re.search(r"(^|\| |[A-Z]=\S+ )neurosnap [a-z]", line)
    ]


VERBS = {
    page: [line for line in commands(page) if not line.startswith("make ")]
    for page in PAGES
}


def test_there_are_as_many_blocks_to_run_as_were_written() -> None:
    """A block in a language that is misspelt would not be run."""
    assert sum(len(blocks(page, "python")) for page in PAGES) == 28
    assert {name_of(page): len(lines) for page, lines in VERBS.items() if lines} == {
        "README": 3,
        "commands": 10,
        "data": 3,
        "health": 2,
        "howto/own_world": 3,
        "howto/read_recordings": 2,
        "robot": 8,
        "tutorials/first_swarm": 6,
        "tutorials/minigrid": 3,
        "tutorials/plant": 11,
    }
    assert sum(len(shown(page)) for page in PAGES) == 3


def steps(page: Path) -> Iterator[tuple[str, list[str]]]:
    """Yield what a page runs, in its order, with the output that it shows right below.

    A line of a command, or a block of Python. Dots stand for lines that are left out.
    """
    text = page.read_text()
    for found in FENCED.finditer(text):
        kind, block = found.groups()
        shown = BELOW.match(text, found.end())
        lines = [line for line in (shown[1] if shown else "").splitlines() if line]
        lines = [line.rstrip() for line in lines if line != "..."]
        if kind == "python":
            yield block, lines
        elif kind == "sh":
            *most, last = [line.split("#")[0].strip() for line in block.splitlines()]
            yield from ((line, []) for line in most)
            yield last, lines


def stands(line: str, said: list[str]) -> bool:
    """Report whether a line that is shown was said; dots stand for its rest."""
    if line.endswith(" ..."):
        return any(one.startswith(line.removesuffix("...")) for one in said)
    return line in said


PYTHON = [
    pytest.param(step, below, id=f"{name_of(page)}-{place}")
    for page in PAGES
    if not VERBS[page]
    for place, (step, below) in enumerate(steps(page))
    if not step.startswith("make ")
]
"""Of pages without commands: what stands beside commands is run with them."""

FIRST_READ = ("README", "tutorials/first_swarm")
"""Pages whose commands `make test` runs; `make test-all` runs those of all pages."""


@pytest.mark.parametrize(("text", "below"), PYTHON)
def test_python_blocks_run(text: str, below: list[str], tmp_path: Path) -> None:
    code, output, errors = run_loaded(text, tmp_path)
    assert code == 0, errors
    assert [line for line in below if not stands(line, output.splitlines())] == []


@pytest.mark.zenoh
@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    [
        pytest.param(
            page,
            id=name_of(page),
            marks=[] if name_of(page) in FIRST_READ else [pytest.mark.exhaustive],
        )
        for page in PAGES
        if VERBS[page]
    ],
)
def test_a_page_runs_and_says_what_it_shows(page: Path, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    said = {}
    for step, below in steps(page):
        if step.startswith("make "):
            continue
        is_verb = "\n" not in step
        # The README's first commands are run as a reader runs them, the others faster.
        as_read = is_verb and (page == README or not step.startswith("neurosnap "))
        run = run_program if as_read else run_loaded
        code, output, errors = run(step, tmp_path)
        differs = "compare" in step  # what it then ends with, as a check does
        assert code == differs, f"{step}: {output}{errors}"
        said[step] = [line.rstrip() for line in output.splitlines()]
        assert [line for line in below if not stands(line, said[step])] == [], step
        for name in re.findall(r"--out (\S+)", step) if is_verb else ():
            assert (tmp_path / name).exists(), step
    for line, shown_output in shown(page).items():
        assert set(shown_output) <= set(said[line]), line
    if "--out depths" in " ".join(said):
        assert (tmp_path / "depths" / "depth.png").stat().st_size > 0


def run_program(step: str, folder: Path) -> tuple[int, str, str]:
    """Run a command line; return its exit code and what it said."""
    bin_folder = str(Path(sys.executable).parent)
    environment = {**os.environ, "PATH": f"{bin_folder}:{os.environ['PATH']}"}
    words = shlex.split(step)
    while found := ASSIGNED.fullmatch(words[0]):
        environment[found[1]] = found[2]
        del words[0]
    done = subprocess.run(
        words,
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    return done.returncode, done.stdout, done.stderr


def run_loaded(step: str, folder: Path) -> tuple[int, str, str]:
    """Run a verb or a program in a process that has all loaded that it imports.

    See `tests.support.commands`. A program finds what is in examples/.
    """
    assert not OF_A_CHECKOUT.search(step), "must run where a wheel is installed, too"
    program = f"import sys; sys.path.insert(0, 'examples')\n{step}"
    arguments = ["-c", program] if "\n" in step else shlex.split(step)[1:]
    with Command(*arguments, folder=folder) as command:
        output, errors = command.communicate(PATIENCE)
        return command.wait(PATIENCE), output, errors


def options(words: list[str]) -> set[str]:
    """Return the options of the command that `words`, after the program, begin with."""
    command = PROGRAM
    for word in words:
        if not hasattr(command, "commands"):
            break
        assert word in command.commands, f"no command {word} in {words}"
        command = command.commands[word]
    return {name for given in command.params for name in given.opts} | {"--help"}


@cache
def all_options() -> frozenset[str]:
    """Return the options of every command."""
    found, waiting = {"--help"}, [PROGRAM]
    while waiting:
        command = waiting.pop()
        waiting += getattr(command, "commands", {}).values()
        for given in command.params:
            found.update(given.opts, given.secondary_opts)
    return frozenset(found)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_commands_and_their_options_exist(page: Path) -> None:
    for line in mentioned(page):
        words = line[line.index("neurosnap ") :].split()[1:]
        strange = {word for word in words if OPTION.fullmatch(word)} - options(words)
        assert not strange, line
    # The tools have options of their own.
    for code in INLINE.findall(FENCED.sub("", page.read_text())):
        if not code.startswith("tools/"):
            assert set(OPTION.findall(code)) <= all_options(), code


@pytest.mark.parametrize("page", LINKED, ids=name_of)
def test_what_a_page_names_exists(page: Path) -> None:
    text = page.read_text()
    for name in re.findall(r"(?<![/\w])((?:tools|examples|tests)/[\w.]+\.\w+)", text):
        assert (ROOT / name).is_file(), name
    for name in re.findall(r"\bneurosnap/\w+-v0", text):
        assert name in gymnasium.registry, name
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert set(re.findall(r"`make ([a-z]+)`", text)) <= set(targets)
    for name, tests in re.findall(r"`(tests/[\w/]+\.py)((?:::\w+)+)`", text):
        for test in tests.split("::")[1:]:
            definition = rf"^ *(?:async )?(?:def|class) {test}\b"
            found = re.search(definition, (ROOT / name).read_text(), re.MULTILINE)
            assert found, test
    for link in re.findall(r"\]\(([^)\s]+)\)", FENCED.sub("", text)):
        if "://" in link:
            continue
        name, _, anchor = link.partition("#")
        target = page.parent / name if name else page
        assert target.is_file(), link
        assert not anchor or anchor in anchors(target), link


@pytest.mark.parametrize("page", LINKED, ids=name_of)
def test_no_page_installs_from_pypi_which_has_another_project(page: Path) -> None:
    named = re.findall(r"pip install '?(neurosnap[\w-]*(?!.*whl).*)", page.read_text())
    assert named == []


def anchors(page: Path) -> set[str]:
    """Return what can be linked to in a page: its headings, as web sites write them."""
    headings = re.findall(r"^#+ (.*)$", FENCED.sub("", page.read_text()), re.MULTILINE)
    return {
        re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")
        for heading in headings
    }


def test_the_pages_name_every_world() -> None:
    named = {
        name
        for page in PAGES
        for name in re.findall(r"\bneurosnap/\w+-v0", page.read_text())
    }
    assert named == set(world._WORLDS)


def test_the_tree_is_the_tree() -> None:
    (tree,) = [
        text for text in blocks(README, "text") if text.startswith("neurosnap/\n")
    ]
    ours = set(re.findall(r"^  (\S+)  ", tree, re.MULTILINE))
    package = ROOT / "neurosnap"
    assert ours == {
        f"{entry.name}/" if entry.is_dir() else entry.name
        for entry in package.iterdir()
        if (entry.suffix == ".py" or any(entry.glob("*.py")))
        and not entry.name.startswith("__")
    }
    beside = re.findall(r"^(\w+)/ ", tree, re.MULTILINE)
    assert beside == ["world", "tools", "examples"]
    assert all((ROOT / name).is_dir() for name in beside)


def test_the_readme_is_short_and_leads_to_every_page() -> None:
    index = ROOT / "docs" / "index.md"
    assert "(docs/index.md)" in README.read_text()
    text = index.read_text()
    made = ROOT / "docs/reference/python"  # led to by the page of that name
    others = [page for page in PAGES[1:] if page != index and page.parent != made]
    assert [
        name for page in others if f"({(name := name_of(page))}.md)" not in text
    ] == []
    assert len(README.read_text().splitlines()) <= 150
