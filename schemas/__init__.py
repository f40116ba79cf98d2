"""Every message on the bus, and the table of keys. Imports nothing of ours."""
