"""The recorder process: writes all traffic of a swarm to a recording."""

import sys
from functools import partial
from importlib import metadata
from pathlib import Path

import msgspec

from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.write.recorder import run_recorder
from neurosnap.recording.write.rotation import Split, SplitWriter
from neurosnap.runtime.parts.job import Job, PartContext
from neurosnap.sources.live.journal import cut, journal_of
from neurosnap.system.distribution import version

_PACKAGES = ("eclipse-zenoh", "mcap", "msgspec", "numpy", "numba")


class RecorderJob(msgspec.Struct, frozen=True):
    """The recorder."""

    path: str
    """Where to record; of several files the first."""
    metadata: dict[str, str]
    """What the recording says of the run."""
    past: ResumePoint | None
    """The recording of a resumed run that it takes over."""
    parts: tuple[str, ...]
    """Whose last words it waits for."""
    split: Split | None = None
    """How it is spread over files; None if it is one."""
    sync: float = 0.0
    """Seconds between two syncs to disk; 0: at the end only."""

    async def run(self, part: PartContext) -> None:
        """Record everything, after what is recorded of a resumed run."""
        with SplitWriter(
            self.path,
            self.metadata,
            self.past,
            split=self.split,
            sync_every=self.sync,
        ) as writer:
            async with part.connection.fabric() as fabric:
                balance = await run_recorder(
                    writer,
                    fabric,
                    part.stop,
                    parts=self.parts,
                    # Cut off no earlier: a run may go on from the last but one.
                    on_safe=partial(cut, journal_of(Path(self.path))),
                    on_ready=part.reporter.ready,
                )
        part.reporter.done(balance)


def recorder_job(
    options: RunOptions,
    log: Path,
    past: ResumePoint | None,
    swarm: str,
    heard: tuple[str, ...],
) -> Job:
    """Return the job of the recorder of a run.

    Args:
        options: The run's.
        log: Where to record.
        past: What the recording takes over.
        swarm: The swarm's id.
        heard: The parts whose last words it waits for.
    """
    facts = {**describe(options), "swarm": swarm}
    return RecorderJob(
        str(log), facts, past, heard, split=split_of(options), sync=options.sync
    )


def split_of(options: RunOptions) -> Split | None:
    """Return how a run's recording is spread over files; None if it is one file."""
    return Split(options.split, options.keep) if options.split else None


def describe(options: RunOptions) -> dict[str, str]:
    """Return the facts of a run, as text: each option, all of them, the versions."""
    facts = {
        name: value if isinstance(value, str) else msgspec.json.encode(value).decode()
        for name, value in msgspec.structs.asdict(options).items()
    }
    versions = {"neurosnap": version()}
    versions |= {name: metadata.version(name) for name in _PACKAGES}
    versions["python"] = ".".join(map(str, sys.version_info[:3]))
    return {
        **facts,
        "sensors": msgspec.json.encode(options.sensors).decode(),
        "options": msgspec.json.encode(options).decode(),
        "versions": msgspec.json.encode(versions).decode(),
    }
