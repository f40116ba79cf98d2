"""Goes to a named state, then straight down and up again: the shortest script that moves an arm."""

import gemelo

with gemelo.connect() as arm:
    print(arm.move(named="ready"))
    print(arm.line(offset=(0, 0, -0.02), speed=0.05))  # [m], [m/s]
    print(arm.line(offset=(0, 0, 0.02)))
    x, y, z = arm.pose().position
    print(f"the tool is at {x:.3f} {y:.3f} {z:.3f} m")
