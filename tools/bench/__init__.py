"""Measures the figures of `make bench`, each beside a reference taken in the same run."""
