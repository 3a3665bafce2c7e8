"""The registry of swarms that run on this machine.

A launcher leaves a note in a folder that only its user can enter, and takes it away
when it ends. A note whose launcher is gone (killed, or the machine restarted) counts
for nothing and is removed by the next that reads the folder.
"""

import hashlib
import os
import socket
import stat
import struct
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec
import psutil

from neurosnap.errors import InvalidValueError, SwarmError
from neurosnap.system.durable import is_own, replace_file

_ENTRY = ".json"
_AGAIN = 0.05  # seconds between two tries for what another process holds


class Note(msgspec.Struct, frozen=True, kw_only=True):
    """A launcher's note about its swarm."""

    swarm: str
    """Its id."""
    pid: int
    """The launcher's process."""
    born: float
    """When that process began: its number may be another's by now."""
    source: str
    """What runs through it."""
    endpoint: str
    """Where its hub listens."""
    log: str
    """Where it is recorded; empty if it is not."""
    behind: str = ""
    """How far it is behind its readings; empty if it is not."""


@contextmanager
def noted(swarm: str, source: str, endpoint: str, log: Path | None) -> Iterator[None]:
    """Register a swarm of this process while the context is entered.

    Notes of launchers that were killed are taken away.

    Raises:
        InvalidValueError: Another one of that id runs here.
    """
    for other in swarms():
        # On one hub the coordinators see to it.
        if other.swarm == swarm and other.endpoint != endpoint:
            rule = f"must not be that of a run here, as of process {other.pid}"
            raise InvalidValueError("swarm", rule, swarm)
    process = psutil.Process()
    note = Note(
        swarm=swarm,
        pid=process.pid,
        born=process.create_time(),
        source=source,
        endpoint=endpoint,
        log="" if log is None else str(log.resolve()),
    )
    path = _own_folder() / f"{swarm}-{process.pid}{_ENTRY}"
    replace_file(path, msgspec.json.encode(note))
    try:
        yield
    finally:
        path.unlink(missing_ok=True)


@contextmanager
def held(path: Path, name: str, patience: float = 0.0) -> Iterator[None]:
    """Hold a recording or a journal, which need not be there, against other processes.

    The hold is a socket of the kernel's with a name made of the path: it leaves no
    file, and goes with the process. Containers do not see each other's.

    Raises:
        InvalidValueError: Another process holds it, for `patience` seconds from now.
    """
    address, until = f"\0{_name(path)}", time.monotonic() + patience
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as hold:
        while True:
            with suppress(OSError):
                hold.bind(address)
                break
            if time.monotonic() >= until:
                rule = f"must be of one run at a time, and {_holder(address)} has it"
                raise InvalidValueError(name, rule, str(path))
            time.sleep(_AGAIN)
        hold.listen()
        yield


def note_behind(behind: str) -> None:
    """Note how far the swarms of this process are behind; empty if they are not."""
    with suppress(OSError, SwarmError):  # no reason to end a run
        for note in swarms():
            if note.pid == os.getpid() and note.behind != behind:
                path = _own_folder() / f"{note.swarm}-{note.pid}{_ENTRY}"
                told = msgspec.structs.replace(note, behind=behind)
                replace_file(path, msgspec.json.encode(told))


def _name(path: Path) -> str:
    """Return the name of the socket that holds a path."""
    return f"neurosnap-{hashlib.sha256(os.fsencode(path.resolve())).hexdigest()}"


def _holder(address: str) -> str:
    """Return which process holds a socket."""
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as end:
        end.connect(address)
        found = end.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12)
        return f"process {struct.unpack('3i', found)[0]}"
    return "another process"


def is_held(path: Path) -> bool:
    """Tell whether a process of this machine holds a recording, as by `held`.

    A run holds its own from one life of its swarm to the next, when there is no note.
    """
    return _name(path) in Path("/proc/net/unix").read_text(encoding="utf-8")


def swarms() -> list[Note]:
    """Return the swarms whose launchers are alive, by id."""
    found = []
    for path in sorted(_own_folder().glob(f"*{_ENTRY}")):
        with suppress(OSError, msgspec.MsgspecError):
            note = msgspec.json.decode(path.read_bytes(), type=Note)
            if _launcher(note) is None:
                path.unlink(missing_ok=True)
            else:
                found.append(note)
    return found


def find(swarm: str = "") -> Note:
    """Return the swarm with an id; without one, the only swarm that runs here.

    Raises:
        InvalidValueError: There is none, or its launcher has ended; or there are
            several.
    """
    there = swarms()
    found = [note for note in there if swarm in ("", note.swarm)]
    if len(found) == 1:
        return found[0]
    known = ", ".join(note.swarm for note in there)
    rule = f"must be one of {known}" if known else "must run on this machine"
    raise InvalidValueError("swarm", rule, swarm or ("several" if known else "none"))


def stop(note: Note, patience: float) -> None:
    """Ask a swarm to end in order, as Ctrl-C would, and wait for `patience` seconds.

    Raises:
        SwarmError: It has not ended by then; it is left alone.
    """
    launcher = _launcher(note)
    if launcher is None:
        return
    try:
        launcher.terminate()
        launcher.wait(patience)
    except psutil.NoSuchProcess:
        return  # it has just ended
    except psutil.TimeoutExpired as error:
        rule = f"must end within {patience:g} s of being asked to"
        raise SwarmError(f"swarm {note.swarm}: {rule}, goes on") from error


def _launcher(note: Note) -> psutil.Process | None:
    """Return the process of a launcher, if it is still that one."""
    with suppress(psutil.NoSuchProcess):
        process = psutil.Process(note.pid)
        if process.create_time() == note.born and process.is_running():
            return process
    return None


def _own_folder() -> Path:
    """Return where notes are, made if it is not there, entered by this user alone.

    It is on this machine, as a home need not be: a note names a process of it.
    """
    base = os.environ.get("XDG_RUNTIME_DIR")
    shared = Path(tempfile.gettempdir()) / f"neurosnap-{os.getuid()}"
    folder = Path(base) / "neurosnap" if base else shared
    folder.parent.mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    if not (folder.is_dir() and is_own(folder, 0o077)):
        found = folder.lstat()  # not where a link leads
        rule = "must be a folder of this user's own, closed to others (chmod 700)"
        got = f"mode {stat.S_IMODE(found.st_mode):o} of user {found.st_uid}"
        raise SwarmError(f"{folder}: {rule}, got {got}")
    return folder
