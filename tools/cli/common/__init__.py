"""Sessions, output, units and errors, for all commands."""
