"""Who speaks: one folder per process."""
