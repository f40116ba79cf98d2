"""Commands of several hosts, certificates and the broker."""
