"""Live sensors over MQTT, and what a run publishes about itself."""
