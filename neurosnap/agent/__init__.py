"""The agent: how it senses, plans and grows sensors, in one process or in a swarm."""
