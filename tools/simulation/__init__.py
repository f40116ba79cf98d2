"""A whole twin in one process and in virtual time: the real services, the firmware's core and its world."""
