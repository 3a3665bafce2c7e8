"""Sends readings to a swarm, or receives its decisions, using only Zenoh.

The swarm comes first. Write these three lines into any.toml:

    [source]
    kind = "zenoh"
    sensors = ["door", "motion"]

and start it where your program can reach it:

    neurosnap run any.toml --swarm home --listen tcp/127.0.0.1:7447

Then, with nothing but `pip install eclipse-zenoh`:

    python any_program.py tcp/127.0.0.1:7447 home door=on motion=off
    python any_program.py tcp/127.0.0.1:7447 home
"""

import json
import sys

import zenoh

USAGE = "usage: python any_program.py ENDPOINT SWARM [SENSOR=on|off|null ...]"


def main() -> None:
    """Send the readings that are given, or print decisions where none are."""
    endpoint, swarm, *readings = sys.argv[1:] if len(sys.argv) > 2 else sys.exit(USAGE)
    if not all("=" in reading for reading in readings):
        sys.exit(USAGE)
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    try:
        session = zenoh.open(config)
    except zenoh.ZError as error:
        why, _, _ = str(error).partition(" at /")  # where in Zenoh helps nobody
        sys.exit(
            f"no swarm listens on {endpoint}; start one first, with"
            f" neurosnap run ... --swarm {swarm} --listen {endpoint} ({why})"
        )
    with session:
        for reading in readings:
            sensor, _, value = reading.partition("=")
            session.put(f"neurosnap/{swarm}/reading/{sensor}", value)
        if not readings:
            decisions = session.declare_subscriber(f"neurosnap/{swarm}/decision")
            for sample in decisions:
                print(sample.payload.to_string(), flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
