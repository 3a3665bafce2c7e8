"""The pure cores of a swarm: cells, workers, waves and the coordinator."""
