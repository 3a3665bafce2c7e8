"""ROS 2: what is said to its programs."""
