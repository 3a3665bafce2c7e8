"""The wheel, installed by itself, does what a checkout does.

Only its dependencies are those of the tests. `tools/wheel` makes whole environments,
for every Python there is.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
from importlib import metadata
from pathlib import Path

import pytest

import world
from neurosnap.system import distribution

pytestmark = [pytest.mark.exhaustive, pytest.mark.slow, pytest.mark.timeout(180)]
_OURS = {"PYTHONPATH", "NUMBA_CACHE_DIR"}
ROOT = Path(__file__).parents[2]
WORLDS = """
import gymnasium, neurosnap_world
for name in neurosnap_world._WORLDS:
    gymnasium.make(f"neurosnap_world:{name}").close()
    print(name)
"""


class Environment:
    """A virtual environment with the wheel, and a folder to run things in."""

    def __init__(self, folder: Path, wheel: Path) -> None:
        home = folder / "environment"
        call(sys.executable, "-m", "venv", "--without-pip", home)
        self.bin = home / "bin"
        (self.packages,) = home.glob("lib/python*/site-packages")
        self.share = home / "share" / "neurosnap"
        self.work = folder / "work"
        self.work.mkdir()
        pip = (sys.executable, "-m", "pip", "--python", self.bin / "python", "--quiet")
        call(*pip, "install", "--no-deps", wheel)
        # Not through their .pth files, so without the checkout that they know.
        borrowed = self.packages / "dependencies.pth"
        borrowed.write_text(sysconfig.get_path("purelib") + "\n")

    def run(self, program: str, *arguments: str, **given: str) -> str:
        given["XDG_CACHE_HOME"] = str(self.work / "cache")
        return call(self.bin / program, *arguments, cwd=self.work, **given)


def call(*command: str | Path, cwd: Path = ROOT, **given: str) -> str:
    """Run a command that must succeed; return what it prints."""
    kept = {name: text for name, text in os.environ.items() if name not in _OURS}
    done = subprocess.run(
        command, cwd=cwd, env=kept | given, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def files(folder: Path) -> set[str]:
    return {
        str(path.relative_to(folder))
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    # A copy: what is built must not depend on what else lies about in a checkout.
    source = tmp_path_factory.mktemp("source") / "neurosnap"
    ignored = shutil.ignore_patterns(".*", "__pycache__", "logs", "tests", "docs")
    shutil.copytree(ROOT, source, ignore=ignored)
    built = tmp_path_factory.mktemp("wheel")
    build = ("-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation")
    call(sys.executable, *build, "--wheel-dir", built, source)
    (path,) = built.glob("neurosnap_uma-*.whl")
    return path


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory, wheel: Path) -> Environment:
    return Environment(tmp_path_factory.mktemp("installed"), wheel)


def test_it_says_which_version_it_is(installed: Environment) -> None:
    assert installed.run("neurosnap", "--version") == (
        f"neurosnap {metadata.version(distribution.NAME)}\n"
    )


def test_a_run_from_it_verifies(installed: Environment) -> None:
    plain = {"NUMBA_DISABLE_JIT": "1"}  # a new installation would compile all anew
    run = ("run", "neurosnap/Path-v0", "--ticks", "20", "--cells", "inline")
    installed.run("neurosnap", *run, "--out", "a.mcap", **plain)
    verified = installed.run("neurosnap", "verify", "a.mcap", **plain)
    assert "20 ticks came out the same" in " ".join(verified.split())


def test_gymnasium_makes_its_worlds(installed: Environment) -> None:
    made = installed.run("python", "-c", WORLDS).split()
    assert made == list(world._WORLDS)


def test_it_takes_no_name_that_is_another_projects(installed: Environment) -> None:
    ours = {path.name for path in installed.packages.glob("*") if path.is_dir()}
    assert ours == {
        "neurosnap",
        "neurosnap_world",
        f"neurosnap_uma-{metadata.version(distribution.NAME)}.dist-info",
    }


def test_page_examples_and_licences_are_in_it(installed: Environment) -> None:
    static = Path("neurosnap") / "apps" / "viewer" / "static"
    assert files(installed.packages / static) == files(ROOT / static)
    assert files(installed.share / "examples") == files(ROOT / "examples")
    (licences,) = installed.packages.glob("*.dist-info/licenses")
    assert files(licences) == {
        "LICENSE",
        "neurosnap/apps/viewer/static/vendor/uplot/LICENSE",
    }
