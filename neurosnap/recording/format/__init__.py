"""The layout of a recording: MCAP records, chunks, schemas, sequence numbers."""
