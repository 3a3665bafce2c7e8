"""Sensors that are outside: their readings come when they come, or do not come at all.

The core is pure: a `LatestReadings` holds the latest reading of every sensor, a
`TickSchedule` says when a tick is due. An `LiveSource` puts both behind a lock, and a
feeder brings it what arrives: lines of standard input (`ndjson`), messages on a swarm's
own keys (`zenoh_keys`), topics of an MQTT broker (`mqtt_source`). Back to a broker goes
what is done, and what a run says of itself (`mqtt_outlet`).
"""
