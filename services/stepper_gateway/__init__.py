"""Trajectories in, step knots to the device, executed steps back as joint states and step errors."""
