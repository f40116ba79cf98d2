"""The device configuration that follows from the description of an arm."""
