"""Rigid transforms and the buffer of frames."""
