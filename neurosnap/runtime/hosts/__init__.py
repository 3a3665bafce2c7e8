"""Swarms on several hosts: services, and the parts that they serve."""
