"""rm1 with plates far below it that stand near to one another for ever."""

from __future__ import annotations

from pathlib import Path

from tests.arm.editing import edit

SIZE, BELOW = 0.02, -1.0  # [m] a plate's edge, and where the first one stands
LINK = """
  <link name="{name}">
    <collision><origin xyz="{x} 0 {z}"/><geometry>{shape}</geometry></collision>
  </link>
  <joint name="{name}_joint" type="fixed"><parent link="{parent}"/><child link="{name}"/></joint>
"""


def add_plate(folder: Path, name: str, parent: str, x: float, z: float, shape: str) -> None:
    """A link with one shape at (x, 0, z) [m] of its parent, fixed to it."""
    text = LINK.format(name=name, parent=parent, x=x, z=z, shape=shape)
    edit(folder / "robot.urdf", "</robot>", text + "</robot>")


def add_rigid_plates(folder: Path, gap: float) -> None:
    """`left_plate` and `right_plate`, `gap` [m] apart, both fixed to the base by way of `mount_plate`."""
    box = f'<box size="{SIZE} {SIZE} {SIZE}"/>'
    add_plate(folder, "left_plate", "base_link", 0.0, BELOW, box)
    add_plate(folder, "mount_plate", "left_plate", -0.5, BELOW, box)
    add_plate(folder, "right_plate", "mount_plate", SIZE + gap, BELOW, box)


def add_turning_disc(folder: Path, gap: float) -> None:
    """`disc` turns with the upper arm about its axis, `gap` [m] above `rest_plate` of the base."""
    add_plate(folder, "rest_plate", "base_link", 0.0, BELOW, f'<box size="{SIZE} {SIZE} {SIZE}"/>')
    add_plate(folder, "disc", "brazo_link", 0.0, BELOW + SIZE + gap, f'<cylinder radius="0.05" length="{SIZE}"/>')
