"""Live sensors over MQTT, and what a run publishes of itself."""
