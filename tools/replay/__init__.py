"""Recorded inputs through the core of one service again, and its outputs beside the recorded ones."""

from gemelo.libraries.runtime.process.arithmetic import use_one_kernel

use_one_kernel()  # as the planner's process does
