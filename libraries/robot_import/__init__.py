"""A CAD export becomes a robot's folder: `gemelo import`."""
