"""Live sensors: readings arrive at any time, or not at all.

The core is pure: `LatestReadings` holds the latest reading of every sensor, a
`TickSchedule` decides when a tick is due. A `LiveSource` puts both behind a lock. A
feeder passes it what arrives: lines of standard input (`stdin_source`), messages on a
swarm's own keys (`zenoh_source`), or topics of an MQTT broker
(`neurosnap.sources.mqtt`), which also publishes actions and the run's status.
"""
