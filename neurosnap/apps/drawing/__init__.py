"""Pictures of an order: its Hasse diagram, by matplotlib or on a page of HTML."""
