"""The processes of a swarm: what each does from its start to its end."""
