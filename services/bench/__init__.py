"""Measures what the project promises, each figure against a reference taken in the same run."""
