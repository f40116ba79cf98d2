"""`ros_bridge`: the arm as a node of ROS 2, without ROS."""
