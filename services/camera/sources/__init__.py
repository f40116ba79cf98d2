"""The sources of images that a camera service can have."""
