"""Sensor health: finds broken sensors from evidence gathered over time.

Pure: readings in, alarms out; no clock, no file. What is expected of a sensor follows
from what the other sensors do. In a home that is how often it comes on (`expectation`),
and five kinds of evidence speak against it (`evidence`); of a machine it is how long it
is on (`level_model`, `level_evidence`). Evidence is weighed by how far it went before
(`tail_probability`); a budget of alarms says how far it has to go (`alarm_budget`).
"""
