"""Plans two moves one after the other, looks at what they would ask of the motors, and executes them then."""

import gemelo

with gemelo.connect() as arm:
    there = arm.plan(named="left", speed=0.5)
    back = arm.plan(named="home", from_joints=there.end)
    for plan in (there, back):
        closest = max(plan.margins.values(), key=lambda margin: margin.share)
        print(f"{plan}: {closest.name} needs {closest.share:.0%} of its {closest.limited_by}")
    for plan in (there, back):
        print(arm.execute(plan))
