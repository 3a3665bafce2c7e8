from pathlib import Path

import pytest

from neurosnap.apps.viewer.names_apart import told_apart


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (["/a/run.mcap"], ["run.mcap"]),
        (["/a/run.mcap", "/a/other.mcap"], ["run.mcap", "other.mcap"]),
        (["/a/run.mcap", "/b/run.mcap"], ["a/run.mcap", "b/run.mcap"]),
        (["/x/a/run.mcap", "/y/a/run.mcap"], ["x/a/run.mcap", "y/a/run.mcap"]),
        (["/run.mcap", "/a/run.mcap"], ["/run.mcap", "a/run.mcap"]),
    ],
)
def test_names_are_as_short_as_they_can_be(paths: list[str], names: list[str]) -> None:
    assert told_apart([Path(path) for path in paths]) == names
