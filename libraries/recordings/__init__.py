"""Recordings: what is kept, how it stands in an MCAP, and what becomes of it afterwards."""
