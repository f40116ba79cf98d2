"""The detector: finds things in the images of cameras, and says their poses."""
