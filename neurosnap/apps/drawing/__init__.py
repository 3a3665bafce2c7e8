"""Pictures of an order: its Hasse diagram, alone or on a page with its table."""
