"""The wire of ROS 2's rmw_zenoh_cpp: names, tokens and attachments, and the entities of a node on it."""
