"""The fabric over Zenoh: sessions, the hub, discovery."""
