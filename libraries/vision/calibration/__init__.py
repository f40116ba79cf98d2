"""Measuring a camera: its lens, and where it stands; each refuses what its measurements cannot determine."""
