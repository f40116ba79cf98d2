"""The checks of a robot's folder: `gemelo check`."""
