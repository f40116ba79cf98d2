"""Recorded inputs through the core of one service again, and its outputs beside the recorded ones."""
