"""Everything to Rerun: the measured twin, the commanded ghost, and every step error."""
