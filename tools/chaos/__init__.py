"""`gemelo chaos`: injects faults into a stack of its own while its virtual arm moves, and judges by invariants."""
