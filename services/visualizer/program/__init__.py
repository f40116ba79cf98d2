"""The rerun program as a process: start, stop, connection, screenshot."""
