"""Bench of the vision: images with exact ground truth, and the figures measured on them."""
