"""The network: cells, waves, the coordinator, and what starts and stops them."""
