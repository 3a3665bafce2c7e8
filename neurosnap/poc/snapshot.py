"""The snapshots there are. Whoever reads a file of any kind must know all of them."""

from neurosnap.poc.base import Snapshot
from neurosnap.poc.discounted import DiscountedSnapshot
from neurosnap.poc.empirical import EmpiricalSnapshot
from neurosnap.poc.evidence import Evidence

__all__ = ["DiscountedSnapshot", "EmpiricalSnapshot", "Evidence", "Snapshot"]
