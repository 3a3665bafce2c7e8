"""A swarm over several hosts: a hub on one, cells on another, the rest on a third.

Hosts are network namespaces joined by a bridge, where the machine allows it; the page
on two hosts does the same on loopback everywhere.
"""

import re
import secrets
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from tests.support.command_line import refused
from tests.support.patience import PATIENCE
from tests.support.ports import free_port
from tests.support.programs import find, needs
from tests.support.view_commands import Verb, verb

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]

HOSTS = ("hub", "cells", "rest")


def command(*arguments: object) -> list[str]:
    return [
        sys.executable,
        "-m",
        "neurosnap",
        *(str(argument) for argument in arguments),
    ]


@contextmanager
def hub_on(before: list[str], *arguments: object) -> Iterator["subprocess.Popen[str]"]:
    """A hub that listens; `before` is what its command line begins with."""
    line = [*before, *command("serve", "hub", *arguments)]
    with subprocess.Popen(line, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        try:
            assert "listening on" in process.stderr.readline()
            yield process
        finally:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=PATIENCE)
            assert process.returncode == 0


def make_keys(folder: Path, *hosts: str) -> None:
    named = [argument for host in hosts for argument in ("--host", host)]
    subprocess.run(
        command("init", "keys", folder, *named),
        check=True,
        capture_output=True,
        timeout=PATIENCE,
    )


def play(
    hosts: dict[str, list[str]], endpoint: str, keys: Path, log: Path
) -> "subprocess.CompletedProcess[str]":
    """Run a swarm of six cells, four of them on the host ``cells``."""
    network = ("--connect", endpoint, "--tls", keys)
    small = ("neurosnap/Path-v0", "--set", "places=7", "--ticks", 40, "--out", log)
    share = [*hosts["cells"], *command("serve", "cells", "demo", "1,3-5", *network)]
    with subprocess.Popen(share, stderr=subprocess.PIPE, text=True) as joined:
        whole = [
            *hosts["rest"],
            *command(
                "run", *small, "--swarm", "demo", "--elsewhere", "1,3-5", *network
            ),
        ]
        try:
            done = subprocess.run(
                whole, capture_output=True, text=True, timeout=PATIENCE, check=False
            )
            _, said = joined.communicate(timeout=PATIENCE)
        finally:
            joined.kill()
    assert joined.returncode == 0, said
    return done


def is_right(log: Path) -> None:
    verdict = verify(log)
    assert (verdict.same, verdict.complete, verdict.ticks) == (True, True, 40)
    parts = Recording.open(log).noted().expected
    assert {f"cell/{cell}" for cell in range(6)} <= set(parts)


@contextmanager
def namespaces() -> Iterator[dict[str, tuple[str, str]]]:
    """Three hosts on one bridge: for each, its namespace and its address.

    Skips the test where this machine allows none.
    """
    ip = find("ip")
    assert ip is not None
    mark = secrets.token_hex(2)

    def run(*arguments: str) -> "subprocess.CompletedProcess[str]":
        return subprocess.run(
            [ip, *arguments],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
        )

    bridge = f"nsb{mark}"
    tried = run("link", "add", bridge, "type", "bridge")
    if tried.returncode:
        pytest.skip(f"no bridge may be made here: {tried.stderr.strip()}")
    with ExitStack() as stack:
        stack.callback(run, "link", "del", bridge)
        assert run("link", "set", bridge, "up").returncode == 0
        hosts = {}
        for number, host in enumerate(HOSTS, 1):
            space, outer, inner = (
                f"ns{mark}{host}",
                f"v{mark}{number}",
                f"w{mark}{number}",
            )
            made = run("netns", "add", space)
            if made.returncode:
                pytest.skip(f"no namespace may be made here: {made.stderr.strip()}")
            stack.callback(run, "netns", "del", space)
            address = f"10.213.7.{number}"
            for line in (
                f"link add {outer} type veth peer name {inner} netns {space}",
                f"link set {outer} master {bridge} up",
                f"-n {space} addr add {address}/24 dev {inner}",
                f"-n {space} link set {inner} up",
                f"-n {space} link set lo up",
            ):
                done = run(*line.split())
                if done.returncode:
                    pytest.skip(f"ip {line}: {done.stderr.strip()}")
            hosts[host] = space, address
        yield hosts


@pytest.mark.exhaustive
@needs("ip", "iproute2")
def test_three_hosts_make_one_swarm(tmp_path: Path) -> None:
    with namespaces() as hosts:
        before = {name: ["ip", "netns", "exec", hosts[name][0]] for name in HOSTS}
        address = hosts["hub"][1]
        make_keys(tmp_path / "keys", address)
        endpoint = f"tls/{address}:7447"
        log = tmp_path / "log.mcap"
        with hub_on(before["hub"], "--listen", endpoint, "--tls", tmp_path / "keys"):
            done = play(before, endpoint, tmp_path / "keys", log)
        assert done.returncode == 0, done.stderr
        is_right(log)


# The page "a swarm on two hosts": its commands, in its order, and what they say

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/tutorials/two_hosts.md").read_text()
COMMANDS = re.findall(r"^\$ neurosnap (.*)$", PAGE, re.MULTILINE)
SHOWN = dict(re.findall(r"^\$ neurosnap (.*)\n((?:[^$`].*\n)*)", PAGE, re.MULTILINE))


async def done(folder: Path, line: str) -> list[str]:
    """Run a command to its end; return what it said."""
    async with verb(folder, *shlex.split(line)) as process:
        output, errors = await process.communicate()
        assert process.returncode == 0, f"{line}: {errors.decode()}"
    return [each.rstrip() for each in output.decode().splitlines()]


async def told(process: Verb, line: str) -> None:
    """Wait until a command that goes on says a line."""
    while said := (await process.stderr.readline()).decode():
        if said.strip() == line:
            return
    pytest.fail(f"ended without {line!r}")


async def test_the_page_runs(tmp_path: Path) -> None:
    port = str(free_port())
    keys, hub, join, run, verify = [line.replace("7447", port) for line in COMMANDS]
    listening, joined = [
        SHOWN[line].strip().replace("7447", port) for line in COMMANDS[1:3]
    ]
    said = await done(tmp_path, keys)
    assert SHOWN[COMMANDS[0]].strip() in said
    async with verb(tmp_path, *shlex.split(hub)) as hubs:
        await told(hubs, listening)
        async with verb(tmp_path, *shlex.split(join)) as cells:
            await told(cells, joined)
            said = await done(tmp_path, run)
            shown = SHOWN[COMMANDS[3]].splitlines()
            assert len(shown) == 5
            assert [line for line in shown if line not in said] == []
            assert await cells.wait() == 0
        hubs.send_signal(signal.SIGINT)
        assert await hubs.wait() == 0
    assert any(line.startswith("same:") for line in await done(tmp_path, verify))


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("--elsewhere", "1"), "elsewhere: must come with --swarm ID"),
        (
            ("--elsewhere", "9", "--swarm", "a", "--listen", "tcp/127.0.0.1:7447"),
            "elsewhere: must be cells of the swarm, 0 to 5, got '9'",
        ),
        (
            ("--elsewhere", "x", "--swarm", "a", "--listen", "tcp/127.0.0.1:7447"),
            "elsewhere: must be like 0-499 or 3,7,9-12, of at most six digits, got 'x'",
        ),
        (("--swarm", "a/b"), "swarm: must be letters and digits, got 'a/b'"),
        (
            ("--connect", "tcp/127.0.0.1:1", "--listen", "tcp/127.0.0.1:2"),
            "connect: must not come with an endpoint to listen on",
        ),
        (("--connect", "tcp/192.0.2.1:7447"), "connect: must be tcp/ on loopback"),
    ],
)
def test_what_cannot_be_shared_is_refused(
    options: tuple[str, ...], text: str, tmp_path: Path
) -> None:
    small = ("neurosnap/Path-v0", "--set", "places=7", "--out", tmp_path / "log")
    assert text in refused("run", *small, *options)
    assert not (tmp_path / "log").exists()
