"""Seeing as mathematics: images and lenses in, poses and calibrations out; it knows no bus and no process."""
