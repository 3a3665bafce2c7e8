"""A part may do at linked hubs exactly what it may do at its own."""

import asyncio
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import zenoh

from neurosnap import wire
from neurosnap.fabric.security.hub_address import Credentials
from neurosnap.fabric.security.make_keys import make_keys
from neurosnap.fabric.zenoh.session import configuration
from tests.support.fabrics import Seen, are_one_network
from tests.support.intrusions import (
    conduct_others,
    spy_on_others,
)
from tests.support.ports import free_port
from tests.support.secured_hub import Hub, hub_with
from tests.support.services import going
from tests.support.witnesses import Heard

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]


@contextmanager
def line(role_keys: Path) -> Iterator[tuple[Hub, Hub]]:
    """The ends of a line of three hubs."""
    with (
        hub_with(role_keys) as here,
        hub_with(role_keys, here) as between,
        hub_with(role_keys, between) as there,
    ):
        asyncio.run(are_one_network(here.end, there.end))
        yield here, there


def test_a_cell_neither_conducts_nor_hears_those_on_another_hub(
    role_keys: Path,
) -> None:
    with line(role_keys) as (here, there):
        asyncio.run(conduct_others(here, there))
        asyncio.run(spy_on_others(here, there))


def test_a_router_that_is_no_hub_is_named(role_keys: Path) -> None:
    endpoint = f"tls/127.0.0.1:{free_port()}"
    with going("serve", "hub", "--listen", endpoint, "--tls", role_keys) as hub:
        assert "listening on" in hub.stderr.readline()
        config = configuration(
            "router",
            connect__endpoints=[endpoint],
            transport__link__tls=Credentials.in_folder(role_keys, "cell").to_connect(),
        )
        with zenoh.open(config):
            said = hub.stderr.readline()
    assert said.startswith(
        "cell is linked and no hub: what hubs send each other may be"
    )


def test_hubs_of_different_keys_are_not_linked(role_keys: Path, tmp_path: Path) -> None:
    make_keys(tmp_path / "others")
    with hub_with(role_keys) as hub, hub_with(tmp_path / "others", hub) as stranger:

        async def pass_by() -> None:
            heard, seen, mark = Heard(), Seen(), secrets.token_hex(2)
            async with hub.end("recorder") as ears, hub.end("cell/1") as cell:
                await ears.subscribe(("**",), heard)
                await ears.watch(seen)
                async with stranger.end("world") as world:
                    await world.announce()
                    world.publish(wire.Leave("world"))
                    await world.confirm()
                await cell.announce()
                await seen.wait(("cell/1", True))
                fault = wire.Fault("cell/1", mark)
                cell.publish(fault)
                assert await heard.wait(fault) == [fault]
                assert seen.changes == [("cell/1", True)]

        asyncio.run(pass_by())
    assert any(line.startswith("session refused:") for line in hub.refused)
