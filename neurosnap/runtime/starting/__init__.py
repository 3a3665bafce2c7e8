"""How parts are started: as child processes, or as actors of a Ray cluster."""
