"""What a process needs beside its node: logs, readiness, ports, shutdown."""
