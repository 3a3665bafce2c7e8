"""A router of ROS 2, which is one of Zenoh's, and sessions with it."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
import zenoh

from neurosnap.fabric.zenoh.connect_session import configuration
from neurosnap.sources.ros2.graph import open_session
from tests.support.ports import free_port


@pytest.fixture(scope="package")
def router() -> Iterator[str]:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with zenoh.open(configuration("router", listen__endpoints=[endpoint])):
        yield endpoint


@pytest.fixture
def connect(router: str) -> Iterator[Callable[[], zenoh.Session]]:
    """Open sessions, and close them all at the end."""
    with ExitStack() as sessions:
        yield lambda: sessions.enter_context(open_session(router))
