"""The ledger of lost steps: verified counts, confidence, tool error, stopping distance."""
