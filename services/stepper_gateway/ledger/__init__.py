"""What the gateway knows of lost steps: verified counts, confidence, tool error, stopping distance."""
