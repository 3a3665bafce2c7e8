"""The experiments behind the figures, run and measured."""
