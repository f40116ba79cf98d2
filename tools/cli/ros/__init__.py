"""Commands about the arm as a node of ROS 2."""
