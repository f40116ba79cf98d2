"""Starts the whole stack, for `make up`, tests, demo and bench; no service imports it."""
