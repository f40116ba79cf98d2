"""Measures what `architecture.md` promises, each figure against a reference taken in the same run."""
