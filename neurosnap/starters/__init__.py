"""Starters of parts that are found by their entry points; nothing imports them."""
