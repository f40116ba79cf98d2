"""Boards that speak another dialect than ours: the firmware's core stands in for them, and its steps are passed on."""
