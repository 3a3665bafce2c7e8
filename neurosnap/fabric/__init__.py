"""Carries messages between parts: over Zenoh, or in memory."""
