"""Makes an in-memory hub deliver all messages in flight."""

from neurosnap.fabric.in_memory import MemoryHub


def run_out(hub: MemoryHub, most: int = 10_000_000) -> int:
    """Deliver until nothing is under way; return how many it took."""
    for count in range(most):
        if not hub.step():
            return count
    raise RuntimeError(f"hub: must fall silent within {most} deliveries")
