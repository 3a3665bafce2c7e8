"""How messages travel: one protocol, two implementations, one test suite."""
