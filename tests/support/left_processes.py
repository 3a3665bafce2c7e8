"""Processes that a test may have left."""

import psutil

from tests.support.patience import PATIENCE


def assert_no_process_is_left() -> None:
    """Fail if a child is there, other than those that serve for good."""
    left = []
    for child in psutil.Process().children():
        command = " ".join(child.cmdline())
        if "forkserver" in command:
            left += child.children(recursive=True)
        elif "resource_tracker" not in command:
            left.append(child)
    _, alive = psutil.wait_procs(left, timeout=PATIENCE)  # the fork server may yet reap
    assert alive == []
