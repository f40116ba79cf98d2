"""The gripper: the action `gripper_command` and the state of the jaws."""
