"""Starts the tests' fork server with compiled code loaded.

Each coordinator, worker and reader of recordings would load the compiled code anew:
half a second of work, in hundreds of swarms.
"""

import ctypes
import gc
import warnings

import numpy as np

from neurosnap.agent import clone_kernels
from neurosnap.health.level_evidence import Levels
from neurosnap.health.level_monitor import FIRST, LevelMonitor
from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.protocol import worker_kernels
from neurosnap.recording.format import chunk_index

_snapshots = EmpiricalSnapshot(2), EmpiricalSnapshot(2, "auto"), DiscountedSnapshot(2)
for _snapshot in _snapshots:
    for _known in (None, np.array([True, False])):
        _snapshot.observe(np.array([True, False]), _known)
        _graph = _snapshot.poc_graph()
        _graph.wire_list("hasse")
        _graph.wire_list("derived")
# As workers learn: twins before the share part twice, and the second time find room.
_thresholds: tuple[float | str, ...] = (0.1, "auto")
for _threshold in _thresholds:
    _share, _order = (
        EmpiricalSnapshot(6, _threshold, share) for share in (range(4, 6), range(0))
    )
    for _count in (6, 3, 2):
        for _each in (_share, _order):
            _each.learn(np.arange(6) < _count)
        _found = _share.changes()
        _ends = _found.latter.astype(np.intp), _found.former.astype(np.intp)
        _order.relate(*_ends, _found.codes)
DiscountedSnapshot(6, 0.1, 0.9, range(4, 6)).learn(np.ones(6))
worker_kernels.warm()
clone_kernels.warm()
_levels = np.ones((FIRST + 2, 2))
LevelMonitor(range(2)).follow(Levels(_levels, _levels), 0)
# As a chunk is given to it: of bytes that cannot be written to.
chunk_index._walk(np.frombuffer(b"", np.uint8), np.empty((0, 4), np.int64))
# A launcher that is forked from here need not walk over all of this again and again.
gc.collect()
gc.freeze()

# Processes whose parent has ended become children of the fork server, which waits for
# them: so `tests.support.processor_time` counts what they cost.
_PR_SET_CHILD_SUBREAPER = 36
ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1)
warnings.filterwarnings("ignore", "forkserver: waitpid returned unexpected pid")
