"""The bus: its interface, its Zenoh and in-memory implementations, and what travels on it."""
