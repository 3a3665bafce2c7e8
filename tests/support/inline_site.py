"""A swarm each of whose parts is a task of this process, workers included."""

from neurosnap.runtime.inline_tasks import InlineTasks
from neurosnap.runtime.request import Site
from neurosnap.runtime.starter import Starter


class InlineSite(Site):
    """Starts every part as a task, whatever kind of cells the run has."""

    def starter(self) -> Starter:
        return InlineTasks()
