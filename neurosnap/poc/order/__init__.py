"""Orders of implications between sensors, and what follows from them."""
