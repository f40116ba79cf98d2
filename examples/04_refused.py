"""Asks for what cannot be, reads why, and takes the nearest goal that can."""

import gemelo

with gemelo.connect() as arm:
    x, y, z = arm.fk(arm.states["ready"]).position
    try:
        arm.move(position=(3 * x, 3 * y, z))
    except gemelo.Refused as refused:
        print(refused)
        print("check:", refused.check, "subject:", refused.subject)
        print(arm.move(**refused.nearest))
