"""Commands of topics, requests, actions, nodes and parameters."""
