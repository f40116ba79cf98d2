"""The arm as mathematics: description, steps, speed, kinematics, interpolation, frames. Imports only `schemas`."""
