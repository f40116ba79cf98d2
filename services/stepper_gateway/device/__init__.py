"""The device: its session, configuration, commands and reports."""
