"""Arms that do not ship, written as robot folders: kinematics from published tables, collision shapes of our own.

`six` is a UR5 by its Denavit-Hartenberg table (Universal Robots, "DH parameters for calculations"), with cylinders,
boxes and spheres; `six_mesh` the same with the hulls of its long links as meshes; `six_raw` as a stranger has it, each
link one raw mesh, and no two links excused that are always near. `seven` is a Panda by its table after Craig (Franka
Emika, "Robot and interface specifications"), of spheres alone; `eight` the same on a rail.
"""

from __future__ import annotations

import atexit
import math
import tempfile
from collections.abc import Container, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import trimesh

from gemelo.libraries.arm.model.description import ArmDescription, load_arm

Point = tuple[float, float, float]
HALF = math.pi / 2.0
RAIL, RAIL_SPEED = 0.4, 0.5  # [m] either way, [m/s]
SECTIONS, BALL_DIVISIONS = 40, 3  # of a mesh's cylinders and balls
MESHED = (2, 3)  # links of which meshes are made: the upper arm and the forearm
ALWAYS_TOUCHING = ((0, 2),)  # links of `six`


@dataclass(frozen=True)
class SketchSolid:
    """A cylinder along `axis` with (radius, length), a ball with (radius,), or a box with its edges; [m]."""

    size: tuple[float, ...]
    at: Point
    axis: str = "z"

    @property
    def turn(self) -> Point:
        """Roll, pitch, yaw [rad] that bring z to the axis."""
        return {"x": (0.0, HALF, 0.0), "y": (HALF, 0.0, 0.0), "z": (0.0, 0.0, 0.0)}[self.axis]


@dataclass(frozen=True)
class MovingLink:
    """A joint about its z at `origin` [m], `twist` [rad] about x of the link before, and the link behind it; along its
    z where it `slides`."""

    origin: Point
    twist: float
    limits: tuple[float, float]  # [rad] or [m]
    velocity: float  # [rad/s] or [m/s]
    solids: tuple[SketchSolid, ...]
    slides: bool = False


@dataclass(frozen=True)
class ArmSketch:
    """An arm; the tool is `tool` [m] in the last link's frame, turned by `tool_twist` [rad] about x."""

    name: str
    base: tuple[SketchSolid, ...]
    links: tuple[MovingLink, ...]
    tool: Point
    excused: tuple[tuple[int, int], ...]  # links that never touch, or always do; the base is 0
    home: tuple[float, ...]  # [rad]
    tool_twist: float = 0.0


def balls(start: Point, end: Point, radius: float, count: int) -> tuple[SketchSolid, ...]:
    """So many balls of `radius` [m] from one centre to another [m]."""
    rows = np.linspace(start, end, count).tolist()
    return tuple(SketchSolid((radius,), (x, y, z)) for x, y, z in rows)


def six_joints(name: str = "six") -> ArmSketch:
    """UR5: a [m], d [m] and alpha [rad] behind each joint."""
    table = (
        (0.0, 0.089159, HALF),
        (-0.425, 0.0, 0.0),
        (-0.39225, 0.0, 0.0),
        (0.0, 0.10915, HALF),
        (0.0, 0.09465, -HALF),
        (0.0, 0.0823, 0.0),
    )
    solids = (
        (SketchSolid((0.058, 0.10), (0.0, 0.0, 0.095)), SketchSolid((0.06,), (0.0, 0.0, 0.10))),
        (
            SketchSolid((0.058, 0.12), (0.0, 0.0, 0.125)),
            SketchSolid((0.05, 0.36), (-0.2125, 0.0, 0.136), "x"),
            SketchSolid((0.053,), (-0.425, 0.0, 0.136)),
            SketchSolid((0.10, 0.09, 0.09), (-0.05, 0.0, 0.136)),
        ),
        (
            SketchSolid((0.045, 0.07), (0.0, 0.0, 0.045)),
            SketchSolid((0.042, 0.33), (-0.20, 0.0, 0.016), "x"),
            SketchSolid((0.044,), (-0.39225, 0.0, 0.016)),
        ),
        (SketchSolid((0.038, 0.09), (0.0, 0.0, 0.085)), SketchSolid((0.04,), (0.0, 0.0, 0.10915))),
        (SketchSolid((0.037, 0.10), (0.0, 0.0, 0.07)),),
        (
            SketchSolid((0.034, 0.05), (0.0, 0.0, 0.06)),
            SketchSolid((0.07, 0.12, 0.05), (0.0, 0.0, 0.112)),
            SketchSolid((0.02, 0.015, 0.05), (0.0, 0.045, 0.162)),
            SketchSolid((0.02, 0.015, 0.05), (0.0, -0.045, 0.162)),
        ),
    )
    before: tuple[tuple[float, float, float], ...] = ((0.0, 0.0, 0.0), *table[:-1])
    links = tuple(
        MovingLink((a, 0.0, d), alpha, (-math.tau, math.tau) if number != 2 else (-math.pi, math.pi), math.pi, shapes)
        for number, ((a, d, alpha), shapes) in enumerate(zip(before, solids, strict=True))
    )
    base = (SketchSolid((0.07, 0.04), (0.0, 0.0, 0.02)),)
    excused = ((0, 2), (3, 5), (4, 6))
    return ArmSketch(name, base, links, (0.0, 0.0, 0.182), excused, (0.0, -1.57, 1.2, -1.2, -1.57, 0.0))


def seven_joints() -> ArmSketch:
    """Panda: a [m], d [m] and alpha [rad] before each joint, its limits [rad] and its velocity [rad/s]."""
    table = (
        (0.0, 0.333, 0.0, -2.8973, 2.8973, 2.175),
        (0.0, 0.0, -HALF, -1.7628, 1.7628, 2.175),
        (0.0, 0.316, HALF, -2.8973, 2.8973, 2.175),
        (0.0825, 0.0, HALF, -3.0718, -0.0698, 2.175),
        (-0.0825, 0.384, -HALF, -2.8973, 2.8973, 2.61),
        (0.0, 0.0, HALF, -0.0175, 3.7525, 2.61),
        (0.088, 0.0, HALF, -2.8973, 2.8973, 2.61),
    )
    solids = (
        (*balls((0.0, 0.0, -0.18), (0.0, 0.0, -0.06), 0.062, 4), *balls((0.0, -0.04, 0.0), (0.0, -0.07, 0.0), 0.06, 2)),
        (*balls((0.0, 0.0, 0.04), (0.0, 0.0, 0.07), 0.06, 2), *balls((0.0, -0.06, 0.0), (0.0, -0.18, 0.0), 0.06, 4)),
        (
            *balls((0.0, 0.0, -0.11), (0.0, 0.0, -0.05), 0.058, 3),
            *balls((0.04, 0.04, 0.0), (0.0825, 0.06, 0.0), 0.054, 2),
        ),
        (
            *balls((0.0, 0.0, 0.04), (0.0, 0.0, 0.06), 0.054, 2),
            *balls((-0.03, 0.05, 0.0), (-0.0825, 0.12, 0.0), 0.052, 3),
        ),
        (
            *balls((0.0, 0.0, -0.24), (0.0, 0.04, -0.12), 0.052, 5),
            *balls((0.0, 0.055, -0.09), (0.0, 0.06, 0.0), 0.048, 4),
        ),
        (*balls((0.0, 0.0, 0.02), (0.088, 0.0, 0.0), 0.05, 3),),
        (
            *balls((0.0, 0.0, 0.05), (0.0, 0.0, 0.10), 0.044, 3),
            *balls((0.0, -0.08, 0.135), (0.0, 0.08, 0.135), 0.032, 7),
            *balls((0.0, 0.035, 0.175), (0.0, 0.035, 0.20), 0.014, 3),
            *balls((0.0, -0.035, 0.175), (0.0, -0.035, 0.20), 0.014, 3),
        ),
    )
    links = tuple(
        MovingLink((a, -math.sin(alpha) * d, math.cos(alpha) * d), alpha, (lower, upper), velocity, shapes)
        for (a, d, alpha, lower, upper, velocity), shapes in zip(table, solids, strict=True)
    )
    base = balls((-0.09, 0.0, 0.065), (0.0, 0.0, 0.065), 0.062, 3)
    excused = tuple((index, index + 2) for index in range(6))
    home = (0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785)
    return ArmSketch("seven", base, links, (0.0, 0.0, 0.2104), excused, home)


def eight_joints() -> ArmSketch:
    """The arm of seven joints with its base on a slide along y; the rail itself has no shape."""
    seven = seven_joints()
    first = seven.links[0]
    base = tuple(SketchSolid(solid.size, (solid.at[0], -solid.at[2], solid.at[1])) for solid in seven.base)
    links = (
        MovingLink((0.0, 0.0, 0.0), -HALF, (-RAIL, RAIL), RAIL_SPEED, base, slides=True),
        replace(first, origin=(0.0, -first.origin[2], 0.0), twist=HALF),
        *seven.links[1:],
    )
    excused = tuple((one + 1, other + 1) for one, other in seven.excused)
    return ArmSketch("eight", (), links, seven.tool, excused, (0.0, *seven.home))


@cache
def generated_arm(name: str) -> ArmDescription:
    """`six`, `six_mesh`, `six_raw`, `seven` or `eight`; its folder lasts as long as the process."""
    folder = tempfile.TemporaryDirectory(prefix="gemelo_bench_")
    atexit.register(folder.cleanup)
    sketch = {"seven": seven_joints, "eight": eight_joints}.get(name, lambda: six_joints(name))()
    if name == "six_raw":
        return load_arm(written(replace(sketch, excused=ALWAYS_TOUCHING), Path(folder.name) / name, range(7), False))
    return load_arm(written(sketch, Path(folder.name) / name, MESHED if name == "six_mesh" else ()))


ARMS = ("six", "six_mesh", "seven")


def written(sketch: ArmSketch, folder: Path, meshed: Container[int] = (), as_hulls: bool = True) -> Path:
    """The robot's folder with robot.urdf, robot.srdf, robot.toml, and the `meshed` links as meshes, of their hulls or
    of their solids as they are."""
    folder.mkdir(parents=True)
    solids = [sketch.base, *(link.solids for link in sketch.links)]
    links = [_link(folder, number, shapes, number in meshed, as_hulls) for number, shapes in enumerate(solids)]
    joints = [_joint(number, link) for number, link in enumerate(sketch.links, 1)]
    tool = f'{_origin(sketch.tool, (sketch.tool_twist, 0.0, 0.0))}<parent link="link_{len(sketch.links)}"/>'
    mount = f'<joint name="mount" type="fixed">{tool}<child link="tool"/></joint>'
    lines = ['<?xml version="1.0"?>', f'<robot name="{sketch.name}">', *links, '<link name="tool"/>', *joints, mount]
    (folder / "robot.urdf").write_text("\n".join([*lines, "</robot>"]) + "\n")
    (folder / "robot.srdf").write_text(_srdf(sketch))
    text = f'name = "{sketch.name}"\nbase_frame = "link_0"\ntool_frame = "tool"\n'
    (folder / "robot.toml").write_text(text)
    return folder


def _origin(at: Point, turn: Point) -> str:
    (x, y, z), (roll, pitch, yaw) = at, turn
    return f'<origin xyz="{x:.9g} {y:.9g} {z:.9g}" rpy="{roll:.12g} {pitch:.12g} {yaw:.12g}"/>'


def _joint(number: int, link: MovingLink) -> str:
    (lower, upper), kind = link.limits, "prismatic" if link.slides else "revolute"
    return (
        f'<joint name="joint_{number}" type="{kind}">{_origin(link.origin, (link.twist, 0.0, 0.0))}'
        f'<parent link="link_{number - 1}"/><child link="link_{number}"/><axis xyz="0 0 1"/>'
        f'<limit lower="{lower:.9g}" upper="{upper:.9g}" effort="50" velocity="{link.velocity:.9g}"/></joint>'
    )


def _link(folder: Path, number: int, solids: Sequence[SketchSolid], is_mesh: bool, as_hull: bool) -> str:
    if not is_mesh:
        shapes = "".join(
            f"<collision>{_origin(solid.at, solid.turn)}<geometry>{_form(solid)}</geometry></collision>"
            for solid in solids
        )
        return f'<link name="link_{number}">{shapes}</link>'
    name = f"link_{number}.stl"
    mesh = trimesh.util.concatenate([_meshed(solid) for solid in solids])
    mesh = mesh.convex_hull if as_hull else mesh
    (folder / name).write_bytes(trimesh.exchange.stl.export_stl(mesh))
    return f'<link name="link_{number}"><collision><geometry><mesh filename="{name}"/></geometry></collision></link>'


def _form(solid: SketchSolid) -> str:
    match solid.size:
        case (radius,):
            return f'<sphere radius="{radius:.9g}"/>'
        case (radius, length):
            return f'<cylinder radius="{radius:.9g}" length="{length:.9g}"/>'
    return f'<box size="{" ".join(f"{edge:.9g}" for edge in solid.size)}"/>'


def _meshed(solid: SketchSolid) -> trimesh.Trimesh:
    match solid.size:
        case (radius,):
            mesh = trimesh.creation.icosphere(subdivisions=BALL_DIVISIONS, radius=radius)
        case (radius, length):
            mesh = trimesh.creation.cylinder(radius=radius, height=length, sections=SECTIONS)
        case _:
            mesh = trimesh.creation.box(solid.size)
    mesh.apply_transform(trimesh.transformations.euler_matrix(*solid.turn))
    mesh.apply_translation(solid.at)
    return mesh


def _srdf(sketch: ArmSketch) -> str:
    adjacent = [(number, number + 1) for number in range(len(sketch.links))]
    lines = [f'<robot name="{sketch.name}">', '<group name="arm"><chain base_link="link_0" tip_link="tool"/></group>']
    values = (f'<joint name="joint_{number}" value="{value:g}"/>' for number, value in enumerate(sketch.home, 1))
    lines.append(f'<group_state name="home" group="arm">{"".join(values)}</group_state>')
    lines += [
        f'<disable_collisions link1="link_{one}" link2="link_{other}" reason="{why}"/>'
        for pairs, why in ((adjacent, "Adjacent"), (sketch.excused, "Never"))
        for one, other in pairs
    ]
    return "\n".join([*lines, "</robot>"]) + "\n"
