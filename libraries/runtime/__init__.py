"""The runtime of every service: node, bus, requests, actions and parameters."""
