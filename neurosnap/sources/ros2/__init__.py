"""ROS 2 without ROS: its wire over Zenoh, its messages, what its programs are told."""
