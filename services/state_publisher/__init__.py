"""Joint states in, frames out; the robot's description, latched."""
