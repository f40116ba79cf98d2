"""The Zenoh router of a local run."""
