"""The description of an arm: URDF, SRDF and robot.toml, read and edited."""
