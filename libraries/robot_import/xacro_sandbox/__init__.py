"""Sandbox for foreign xacro files: an interpreter of our own for their expressions, in a process of its own."""
