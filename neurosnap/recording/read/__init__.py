"""Reading a recording: whole, split, growing or damaged."""
