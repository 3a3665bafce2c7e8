"""Imports all kinds of snapshots, so that a file of any kind can be read."""

from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.pairs import Evidence
from neurosnap.poc.learning.snapshot import Snapshot

__all__ = ["DiscountedSnapshot", "EmpiricalSnapshot", "Evidence", "Snapshot"]
