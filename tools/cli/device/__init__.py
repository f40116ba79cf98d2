"""Commands of the controller board."""
