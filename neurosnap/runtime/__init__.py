"""Starts, supervises, restarts and stops the processes of a run."""
