"""The event loop of a node and its task queue."""
