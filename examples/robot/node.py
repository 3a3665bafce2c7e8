"""A simulated robot as a node of ROS 2, seen by every node with rmw_zenoh (Kilted on).

Try it: start a router (``ros2 run rmw_zenoh_cpp rmw_zenohd``), ``python node.py``, and
``ros2 topic echo /mode``. It needs the extra ``ros2``, and no ROS.
"""

import argparse
import itertools
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from neurosnap_world.robot import AFFECTED, RARE, STEP, TYPES, Robot, RobotFault
from neurosnap_world.robot_world import RobotTopics

from neurosnap.sources.ros2.graph import open_session
from neurosnap.sources.ros2.keys_and_tokens import Qos
from neurosnap.sources.ros2.message_types import stock_types
from neurosnap.sources.ros2.node import RosNode


def filled(kind: str, said: Mapping[str, Any]) -> object:
    """Return a message of a type; what is not said of it is 0, empty or false."""
    store = stock_types()
    fields = store.get_msgdef(kind).fields
    values = {name: _value(of, said.get(name)) for name, of in fields}
    return store.types[kind](**values)


def _value(of: tuple[Any, Any], said: Any) -> Any:  # noqa: ANN401 - of any type
    form, inner = of[0].name, of[1]
    if form == "NAME":
        return filled(inner, said or {})
    if form == "BASE":
        zeros = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}
        return zeros.get(inner[0], 0) if said is None else said
    (of_one, size) = inner  # an array, or a sequence of any length
    given = said or [_value(of_one, None)] * (size if form == "ARRAY" else 0)
    if of_one[0].name != "BASE" or of_one[1][0] == "string":
        return list(given)
    return np.array(given, of_one[1][0])


def main() -> None:
    """Drive until Ctrl-C."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--router", default="tcp/localhost:7447")
    parser.add_argument("--speed", type=float, default=1, help="10: ten times as fast")
    parser.add_argument("--seed", type=int, default=0, help="draws room and robot")
    parser.add_argument("--fault", choices=AFFECTED)
    parser.add_argument("--at", type=float, default=420, help="seconds from the start")
    parser.add_argument("--what", help="what fails; without it the seed draws it")
    given = parser.parse_args()
    fault = None
    if given.fault:
        fault = RobotFault.drawn(given.fault, given.at, given.seed, given.what)
    begun = time.time()
    topics = RobotTopics(Robot(given.seed, fault), begun)
    with open_session(given.router) as session:
        node = RosNode(session, "robot")
        latched = Qos(latched=True, depth=1)
        publishers = {
            topic: node.publisher(topic, kind, latched if topic in RARE else Qos())
            for topic, kind in TYPES.items()
        }
        try:
            for step in itertools.count(1):
                time.sleep(max(0, begun + step * STEP / given.speed - time.time()))
                for _, topic, message in topics.step():
                    publishers[topic].publish(filled(TYPES[topic], message))
        except KeyboardInterrupt:
            node.close()


if __name__ == "__main__":
    main()
