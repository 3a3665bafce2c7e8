"""Sensor health: finds broken sensors from evidence gathered over time.

Pure: readings in, alarms out; no clock, no file. What is expected of a sensor follows
from what the other sensors do (`expectation`). Five kinds of evidence speak against it
(`evidence`), each is weighed by how far it went before in the same home
(`tail_probability`); a budget of alarms says how far it has to go (`alarm_budget`).
"""
