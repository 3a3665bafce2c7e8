"""Tell a swarm what your sensors read, or hear what it decides: nothing but Zenoh.

pip install eclipse-zenoh
python any_program.py tcp/127.0.0.1:7447 home door=on motion=off
python any_program.py tcp/127.0.0.1:7447 home
"""

import json
import sys

import zenoh

endpoint, swarm, *readings = sys.argv[1:]
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([endpoint]))
with zenoh.open(config) as session:
    for reading in readings:
        sensor, _, value = reading.partition("=")
        session.put(f"neurosnap/{swarm}/reading/{sensor}", value)
    if not readings:
        decisions = session.declare_subscriber(f"neurosnap/{swarm}/decide")
        for sample in decisions:
            print(sample.payload.to_string(), flush=True)  # noqa: T201
