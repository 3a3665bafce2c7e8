"""What an agent does with its memory, over any propagator."""
