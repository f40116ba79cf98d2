"""The demonstration: a sine and a tour on a stack of its own, measured from what is said on the bus."""
