"""Goals in, verified and timed trajectories out, or a refusal that explains itself."""

from gemelo.libraries.runtime.process.arithmetic import use_one_kernel

use_one_kernel()  # before any module of the planner imports numpy
