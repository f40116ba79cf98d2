"""How services speak: the node, its bus, requests, actions and parameters."""
