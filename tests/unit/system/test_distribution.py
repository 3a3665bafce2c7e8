"""The installed distribution: its name in all texts, version, PyPI namesake."""

import re
import shutil
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from neurosnap.system import distribution

ROOT = Path(__file__).parents[3]
PACKAGE = ROOT / "neurosnap"


def installed_beside_its_namesake(folder: Path) -> Path:
    """A site-packages with the start of ours and PyPI's `neurosnap` in one folder."""
    ours = folder / "neurosnap"
    (ours / "system").mkdir(parents=True)
    for name in ("__init__.py", "__main__.py"):
        shutil.copy(PACKAGE / name, ours)
    for name in ("__init__.py", "distribution.py"):
        shutil.copy(PACKAGE / "system" / name, ours / "system")
    (folder / "neurosnap-2026.10.23.dist-info").mkdir()
    (folder / "neurosnap_uma-0.1.0.dist-info").mkdir()
    return ours


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-P", *arguments],
        env={"PYTHONPATH": str(folder)},
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=30,
    )


REMEDY = "pip uninstall neurosnap neurosnap-uma"


def test_a_namesake_in_the_same_folder_is_warned_of(tmp_path: Path) -> None:
    installed_beside_its_namesake(tmp_path)
    done = run(tmp_path, "-c", "import neurosnap")
    assert done.returncode == 0
    assert "got neurosnap 2026.10.23 there" in done.stderr
    assert REMEDY in done.stderr
    (tmp_path / "neurosnap-2026.10.23.dist-info").rmdir()
    assert run(tmp_path, "-W", "error", "-c", "import neurosnap").stderr == ""


def test_a_namesake_that_came_later_ends_the_command(tmp_path: Path) -> None:
    ours = installed_beside_its_namesake(tmp_path)
    (ours / "__init__.py").write_text("")  # its own is empty, and in the place of ours
    done = run(tmp_path, "-m", "neurosnap", "check")
    assert done.returncode == 1
    assert done.stderr.startswith("error: neurosnap: must not share ")
    assert REMEDY in done.stderr


def test_a_bare_copy_of_the_sources_has_a_version(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def absent(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    assert distribution.version() == metadata.version("neurosnap-uma")
    monkeypatch.setattr(metadata, "version", absent)
    assert distribution.version.__wrapped__() == "0+unknown"


def test_no_text_tells_to_install_the_namesake() -> None:
    texts = [*ROOT.glob("*.md"), *(ROOT / "examples").iterdir(), *PACKAGE.rglob("*.py")]
    # The extras of another project, or that project itself.
    wrong = re.compile(
        r"(?<![-\w/])neurosnap\[\w+\]|pip install[^\n`]*[ '\"]neurosnap\b(?![-_/])"
    )
    found = {
        path.name: wrong.findall(path.read_text()) for path in texts if path.is_file()
    }
    assert {name: each for name, each in found.items() if each} == {}


WITHOUT = """
import sys
missing = sys.argv[1].split(",")
class Missing:
    def find_spec(name, path=None, target=None):
        if name.partition(".")[0] in missing:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Missing)
sys.argv[:2] = ["neurosnap"]
from neurosnap.__main__ import main
main()
"""


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["learn", "run"])
def test_without_any_extra_the_rest_works(tmp_path: Path, verb: str) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    asked = {
        Requirement(each).name.replace("-", "_").lower()
        for some in project["optional-dependencies"].values()
        for each in some
    }
    modules = sorted(
        module
        for module, names in metadata.packages_distributions().items()
        if asked & {name.replace("-", "_").lower() for name in names}
    )
    assert {"xxhash", "rosbags", "uvicorn", "pyarrow"} <= set(modules)
    data = str(ROOT / "examples" / "readings.csv")
    inline = ["--cells", "inline"] if verb == "run" else []
    command = [sys.executable, "-P", "-c", WITHOUT, ",".join(modules), verb, data]
    ended = subprocess.run(
        [*command, *inline],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert ended.returncode == 0, ended.stderr
