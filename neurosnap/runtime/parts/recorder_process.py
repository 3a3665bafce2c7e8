"""The recorder process: writes all traffic of a swarm to a recording."""

from functools import partial
from pathlib import Path

import msgspec

from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.recording.write.recorder import run_recorder
from neurosnap.recording.write.rotation import SplitWriter
from neurosnap.runtime.parts.job import PartContext
from neurosnap.sources.live.journal import cut, journal_of


class RecorderJob(msgspec.Struct, frozen=True):
    """The recorder."""

    path: str
    """Where to record; of several files the first."""
    metadata: dict[str, str]
    """What the recording says of the run."""
    past: ResumePoint | None
    """What it takes over, of a run that is resumed."""
    parts: tuple[str, ...]
    """Whose last words it waits for."""

    async def run(self, part: PartContext) -> None:
        """Record everything, after what there is of a resumed run."""
        with SplitWriter(self.path, self.metadata, self.past) as writer:
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
