"""Everything to MCAP, every command to CSV."""
