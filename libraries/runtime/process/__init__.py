"""Process support: logs, readiness file, port checks, shutdown."""
