"""Commands of cameras and detections."""
