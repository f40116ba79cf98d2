"""What the cameras see, as things with poses."""
