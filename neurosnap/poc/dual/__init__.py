"""The dual of a poc set: its vertices, cubes, maps and topology."""
