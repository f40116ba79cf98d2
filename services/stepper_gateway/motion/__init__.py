"""Knots, streams and what moves the device."""
