"""Loads compiled code into the fork server of the tests, for all that it forks.

Each coordinator, worker and reader of recordings would load it anew: half a second of
work, in hundreds of swarms.
"""

import numpy as np

from neurosnap.poc.learning.kinds import DiscountedSnapshot, EmpiricalSnapshot
from neurosnap.protocol import worker_kernels

for _kind in (EmpiricalSnapshot, DiscountedSnapshot):
    for _known in (None, np.array([True, False])):
        _snapshot = _kind(2)
        _snapshot.observe(np.array([True, False]), _known)
        _graph = _snapshot.poc_graph()
        _graph.wires("hasse")
        _graph.wires("derived")
worker_kernels.warm()
