"""Programs that some tests start, and that a machine may lack."""

import shutil

import pytest

_PATH = "/usr/local/bin:/usr/bin:/bin:/usr/local/sbin:/usr/sbin:/sbin"


def find(program: str) -> str | None:
    """Return where a program is, or None if it is missing."""
    return shutil.which(program) or shutil.which(program, path=_PATH)


def needs(program: str, package: str = "") -> pytest.MarkDecorator:
    """Return what skips a test where a program is missing, and says so.

    Its package is Debian's name for what it comes with, if that is another.
    """
    why = f"needs {program}: apt-get install {package or program}"
    return pytest.mark.skipif(find(program) is None, reason=why)
