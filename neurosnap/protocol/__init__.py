"""The swarm protocol, pure: cells, workers, waves and the coordinator."""
