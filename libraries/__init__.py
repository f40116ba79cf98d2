"""Libraries that several processes and tools stand on."""
