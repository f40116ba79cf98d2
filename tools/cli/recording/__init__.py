"""Commands of recordings, black boxes, replay and chaos."""
