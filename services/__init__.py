"""Processes of the twin: one folder each."""
