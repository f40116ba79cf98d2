"""Leads all joints along a sine about where they stand, for three seconds: targets that the gateway follows."""

import time
from math import pi, sin

import gemelo

AMPLITUDE, PERIOD, RATE = 0.02, 3.0, 20.0  # [rad] or [m], [s], [Hz]

with gemelo.connect() as arm:
    arm.move(named="ready")
    centre = arm.joints
    for beat in range(int(PERIOD * RATE) + 1):
        offset = AMPLITUDE * sin(2 * pi * beat / RATE / PERIOD)
        arm.stream({name: at + offset for name, at in centre.items()})
        time.sleep(1 / RATE)
    print("largest step error:", max(abs(error) for error in arm.step_errors.values()))
