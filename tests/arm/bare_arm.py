"""A robot's folder that tells of no motor."""

from __future__ import annotations

from pathlib import Path

ROBOT = 'name = "bare"\nbase_frame = "base"\ntool_frame = "hand"\n'
URDF = """<robot name="bare">
  <link name="base"/><link name="upper"/><link name="slide"/><link name="hand"/><link name="finger"/>
  <joint name="finger" type="prismatic">
    <parent link="hand"/><child link="finger"/><axis xyz="0 1 0"/>
    <mimic joint="reach" multiplier="0.1"/><limit lower="0" upper="0.1" effort="1" velocity="1"/>
  </joint>
  <joint name="reach" type="prismatic">
    <parent link="upper"/><child link="slide"/><limit lower="0" upper="0.4" effort="9" velocity="0.5"/>
  </joint>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="9" velocity="{velocity}"/>
  </joint>
  <joint name="flange" type="fixed"><parent link="slide"/><child link="hand"/><axis xyz="0 0 0"/></joint>
</robot>"""
SRDF = """<robot name="bare"><group name="arm"><chain base_link="base" tip_link="hand"/></group>
  <group_state name="home" group="arm"><joint name="turn" value="0"/><joint name="reach" value="0"/></group_state>
</robot>"""


def write_bare_arm(folder: Path, robot: str = "", velocity: float = 3.0) -> Path:
    """The folder, with `robot` behind what robot.toml needs at least; `velocity` [rad/s] of its joint that turns."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.toml").write_text(ROBOT + robot)
    (folder / "robot.urdf").write_text(URDF.format(velocity=velocity))
    (folder / "robot.srdf").write_text(SRDF)
    return folder
