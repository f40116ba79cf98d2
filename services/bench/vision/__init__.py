"""What the eyes are measured on: images with exact ground truth, and the figures."""
