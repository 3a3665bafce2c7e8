"""Swarms on several hosts: networks, connections, services, joined parts."""
