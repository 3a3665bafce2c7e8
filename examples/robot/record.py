"""Writes what a simulated robot publishes as an MCAP file, as any other program would.

Try it: ``python record.py robot.mcap --minutes 10 --fault stuck_on --at 420``.
"""

import argparse
import json
from pathlib import Path

from mcap.writer import Writer
from neurosnap_world.robot import AFFECTED, STEP, TYPES, Robot, RobotFault
from neurosnap_world.robot_world import RobotTopics

START = 1_790_000_000  # seconds since 1970: every file has the same times


def record(path: Path, minutes: float, seed: int, fault: RobotFault | None) -> int:
    """Write a file; return how many messages it has."""
    topics = RobotTopics(Robot(seed, fault), START)
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="examples/robot/record.py")
        channels = {}
        for topic, kind in TYPES.items():
            schema = writer.register_schema(kind, "jsonschema", b'{"type": "object"}')
            channels[topic] = writer.register_channel(topic, "json", schema)
        count = 0
        for _ in range(round(minutes * 60 / STEP)):
            for at, topic, message in topics.step():
                time, data = round(at * 1e9), json.dumps(message).encode()
                writer.add_message(channels[topic], time, data, time, count)
                count += 1
        writer.finish()
    return count


def main() -> None:
    """Read the command line, and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path", type=Path)
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--seed", type=int, default=0, help="draws room and robot")
    parser.add_argument("--fault", choices=AFFECTED)
    parser.add_argument("--at", type=float, default=420, help="seconds from the start")
    parser.add_argument("--what", help="what fails; without it the seed draws it")
    given = parser.parse_args()
    fault = None
    if given.fault:
        fault = RobotFault.drawn(given.fault, given.at, given.seed, given.what)
        print(f"from {fault.at:g} s on: {fault.kind} {fault.what}")  # noqa: T201
    count = record(given.path, given.minutes, given.seed, fault)
    print(f"{given.path}: {count} messages, seed {given.seed}")  # noqa: T201


if __name__ == "__main__":
    main()
