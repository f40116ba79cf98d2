"""The virtual device as a process: the firmware of firmware/platform/host on a real wire."""
