"""Goals of follow_joint_trajectory."""
