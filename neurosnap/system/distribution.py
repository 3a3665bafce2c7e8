"""The installed distribution's name, version and extras; its PyPI namesake.

The package `neurosnap` comes in a distribution of another name, since PyPI's
``neurosnap`` is a different project. That project has the same import name, so both
would be installed into one folder.
"""

import functools
import os

NAME = "neurosnap-uma"
"""What pip knows this project by."""
HOME = "https://arxiv.org/abs/1502.06132"
"""Where to read about it: the paper, as in the project's own description."""


@functools.cache
def version() -> str:
    """Return the installed version; ``0+unknown`` in a bare copy of the sources."""
    from importlib import metadata

    try:
        return metadata.version(NAME)
    except metadata.PackageNotFoundError:
        return "0+unknown"


def must_have(package: str, extra: str) -> str:
    """Return the rule of an error: `package` must be there, and `extra` brings it.

    pip reads what an extra holds from the installed distribution, so the command works
    after an install from a wheel or a checkout, too.
    """
    command = f"pip install '{NAME}[{extra}]'"
    return f"must have {package} installed (run `{command}`)"


def namesake() -> str:
    """Return an error text if PyPI's ``neurosnap`` shares our folder; else nothing.

    One look into the folder that holds the package: this runs at every start, and
    importing `importlib.metadata` would take longer than all else.
    """
    around = os.path.dirname(os.path.dirname(os.path.dirname(__file__)))  # noqa: PTH120 - pathlib is slow
    try:
        there = [
            name
            for name in os.listdir(around)  # noqa: PTH208
            if name.startswith("neurosnap-") and name.endswith(".dist-info")
        ]
    except OSError:
        return ""  # a zip file, or a folder that may be entered but not listed
    if not there:
        return ""
    found = there[0].removesuffix(".dist-info").replace("-", " ", 1)
    return (
        f"neurosnap: must not share {around} with PyPI's project of the same name, "
        f"got {found} there (run `pip uninstall neurosnap {NAME}`, then install "
        f"{NAME} again)"
    )
