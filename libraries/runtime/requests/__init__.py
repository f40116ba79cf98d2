"""Requests: client and server."""
