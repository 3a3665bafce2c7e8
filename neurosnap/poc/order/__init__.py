"""Poc graphs and poc sets: literals in an order, and what follows from it."""
