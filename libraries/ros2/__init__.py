"""ROS 2 without ROS: its types and encoding, and our messages as its own."""
