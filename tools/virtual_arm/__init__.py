"""The virtual arm that tests and bench share: the gateway's core on the firmware's core; no service imports it."""
