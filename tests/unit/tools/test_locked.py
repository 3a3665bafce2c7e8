"""The packages CI installs are pinned by hash, and match pyproject.toml."""

import tomllib
from pathlib import Path

import pytest
from packaging.markers import Marker
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
# Two files: what real ROS 2 is made of stands in an environment of its own.
LOCKED = [(ROOT / "tools" / name).read_text() for name in ("locked.txt", "ros2.txt")]
GROUPS = PROJECT["dependency-groups"]
ASKED = [
    *PROJECT["build-system"]["requires"],
    *PROJECT["project"]["dependencies"],
    *PROJECT["project"]["optional-dependencies"]["plot"],
    *(one for group in GROUPS.values() for one in group if isinstance(one, str)),
]


def locked() -> dict[str, str]:
    """Return the versions by name, of this Python."""
    found = {}
    for entry in "".join(LOCKED).replace("\\\n", "").splitlines():
        pin, *hashes = entry.split(" --hash=")
        assert hashes, entry
        requirement = Requirement(pin.strip())
        if requirement.marker is None or Marker(str(requirement.marker)).evaluate():
            (specifier,) = requirement.specifier
            assert specifier.operator == "=="
            found[requirement.name.lower()] = specifier.version
    return found


@pytest.mark.parametrize("asked", ASKED)
def test_what_is_asked_for_is_locked_in_a_version_that_will_do(asked: str) -> None:
    requirement = Requirement(asked)
    assert requirement.specifier.contains(locked()[requirement.name.lower()])
