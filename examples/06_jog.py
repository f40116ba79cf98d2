"""Moves by hand: a joint for half a second, then the tool upwards; silence would stop the arm within 0.1 s."""

import gemelo

with gemelo.connect() as arm:
    arm.move(named="ready")
    first, began = arm.description.joints[0], arm.joints
    arm.jog(joints={first.name: 0.2 * first.velocity}, duration=0.5)
    print(f"{first.name} went {arm.joints[first.name] - began[first.name]:.3f} {first.unit}")
    height = arm.pose().position[2]
    arm.jog(twist=(0, 0, 0.03), duration=0.5)
    print(f"the tool went up {1000 * (arm.pose().position[2] - height):.1f} mm")
