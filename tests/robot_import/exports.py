"""CAD exports as different programs write them, generated: each with the faults that such exports have."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import trimesh

LENGTH, WIDTH, GAP = 0.2, 0.06, 0.03  # [m] of a link, and between two
INERTIAL = '<inertial><origin xyz="0 0 0.1"/><mass value="{mass}"/><inertia {inertia}/></inertial>'
BODY = 'ixx="0.002" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.0004"'
LIMIT = '<limit lower="-2.6" upper="2.6" effort="20" velocity="2"/>'


@dataclass(frozen=True)
class Export:
    """What to import, and what an import has to say of it."""

    source: Path
    says: tuple[str, ...]
    joints: tuple[str, ...]


def mesh(folder: Path, name: str, scale: float = 1.0, length: float = LENGTH) -> None:
    """A link's mesh: a tube of `length` [m] along z, in units of 1/`scale` m."""
    folder.mkdir(parents=True, exist_ok=True)
    body = trimesh.creation.cylinder(radius=WIDTH / 2, height=length, sections=24)
    body.apply_translation((0.0, 0.0, length / 2))
    body.apply_scale(scale)
    if name.lower().endswith(".stl"):
        (folder / name).write_bytes(trimesh.exchange.stl.export_stl(body))
    else:
        body.export(folder / name)


def link(name: str, reference: str = "", scale: str = "", inertial: str | None = None, collision: bool = True) -> str:
    """A link drawn and touched by one mesh."""
    shape = f'<geometry><mesh filename="{reference}"{scale and f""" scale="{scale}" """}/></geometry>'
    drawn = f"<visual>{shape}</visual>" if reference else ""
    touched = f"<collision>{shape}</collision>" if reference and collision else ""
    mass = INERTIAL.format(mass=0.9, inertia=BODY) if inertial is None and reference else inertial or ""
    return f'<link name="{name}">{mass}{drawn}{touched}</link>'


def joint(
    name: str, parent: str, child: str, axis: str = "0 1 0", kind: str = "revolute", rest: str = LIMIT, z: float = 0.23
) -> str:
    """A joint at the end of its parent."""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 {z}" rpy="0 0 0"/><axis xyz="{axis}"/>{rest}</joint>'
    )


def write(path: Path, name: str, *parts: str) -> Path:
    """A URDF of these lines."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(['<?xml version="1.0" encoding="utf-8"?>', f'<robot name="{name}">', *parts, "</robot>"]))
    return path


def package(folder: Path, name: str, build: str = "catkin") -> Path:
    """A ROS package's folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "package.xml").write_text(
        f"<package><name>{name}</name><version>1.0.0</version><buildtool_depend>{build}</buildtool_depend></package>"
    )
    return folder


def solidworks(root: Path) -> Export:
    """sw_urdf_exporter: .STL, package://, zero effort and velocity, no travel, blanks and accents, an axis not unit."""
    folder = package(root / "brazo_description", "brazo_description")
    names = ["base_link", "Eslabón 1", "Eslabón 2"]
    for name in names:
        mesh(folder / "meshes", f"{name}.STL")
    zero = '<limit lower="0" upper="0" effort="0" velocity="0"/>'
    write(
        folder / "urdf" / "brazo_description.urdf",
        "brazo_description",
        *(link(name, f"package://brazo_description/meshes/{name}.STL") for name in names),
        joint("Articulación 1", names[0], names[1], axis="0 0 2", rest=zero),
        joint("Articulación 2", names[1], names[2], axis="0 0.70711 0.70711", rest=zero),
    )
    says = (
        "its limits lack sense (lower 0, upper 0, velocity 0, effort 0)",
        "package path package://brazo_description",
        'link "Eslabón 1": its name has blanks',
        'its axis "0 0 2" is 2 long, not 1',
    )
    return Export(folder, says, ("Articulacion_1", "Articulacion_2"))


def fusion(root: Path) -> Export:
    """fusion2urdf: meshes in millimetres without a scale, file names with blanks, effort 100, continuous joints."""
    folder = package(root / "my arm_description", "my_arm_description")
    for name in ("base_link", "arm v1", "hand"):
        mesh(folder / "meshes", f"{name}.stl", scale=1000.0)
    turns = '<limit effort="100" velocity="1"/>'
    write(
        folder / "urdf" / "my_arm.urdf",
        "my arm",
        link("base_link", "package://my_arm_description/meshes/base_link.stl"),
        link("arm_1", "package://my_arm_description/meshes/arm%20v1.stl"),
        link("hand_1", "package://my_arm_description/meshes/hand.stl"),
        joint("Rev1", "base_link", "arm_1", axis="0.0 0.0 1.0", kind="continuous", rest=turns),
        joint("Rev2", "arm_1", "hand_1"),
        '<gazebo reference="hand_1"><material>Gazebo/Silver</material></gazebo>',
        '<transmission name="t"><type>transmission_interface/SimpleTransmission</type></transmission>',
    )
    says = ('it is in millimetres -> scale="0.001 0.001 0.001"', "exporter's placeholder")
    return Export(folder, says, ("Rev1", "Rev2"))


def ros2(root: Path) -> Export:
    """A ROS 2 package: .dae to look at, relative paths, collision meshes of their own, a ros2_control element."""
    folder = package(root / "ros2_arm", "ros2_arm", "ament_cmake")
    parts = []
    for name in ("base", "upper", "tool0"):
        mesh(folder / "meshes" / "visual", f"{name}.dae")
        mesh(folder / "meshes" / "collision", f"{name}.stl")
        look, touch = (f'<geometry><mesh filename="../meshes/{kind}"/></geometry>'
                       for kind in (f"visual/{name}.dae", f"collision/{name}.stl"))  # fmt: skip
        parts.append(f'<link name="{name}"><visual>{look}</visual><collision>{touch}</collision></link>')
    write(
        folder / "urdf" / "arm.urdf", "ros2_arm", *parts,
        joint("shoulder", "base", "upper"), joint("elbow", "upper", "tool0"),
        '<ros2_control name="x" type="system"><joint name="elbow"/></ros2_control>',
    )  # fmt: skip
    return Export(folder, (), ("shoulder", "elbow"))


def by_hand(root: Path) -> Export:
    """A URDF alone of boxes: massless frames, a zero axis on a fixed joint, a gripper that mimics, no collision."""
    box = '<visual><origin xyz="0 0 0.1"/><geometry><box size="0.06 0.06 0.2"/></geometry></visual>'
    no_mass = INERTIAL.format(mass=0, inertia='ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"')
    finger = '<visual><geometry><box size="0.01 0.01 0.04"/></geometry></visual>'
    slide = '<limit lower="0" upper="0.04" effort="5" velocity="0.1"/>'
    urdf = write(
        root / "hand written.urdf", "panda_like",
        f'<link name="world">{no_mass}</link>',
        *(f'<link name="link{number}">{box}</link>' for number in range(3)),
        '<link name="flange"/>', f'<link name="left">{finger}</link>', f'<link name="right">{finger}</link>',
        '<joint name="to_world" type="fixed"><parent link="world"/><child link="link0"/><axis xyz="0 0 0"/></joint>',
        joint("joint1", "link0", "link1", axis="0 0 1"),
        joint("joint2", "link1", "link2", rest='<limit lower="-3.0" upper="-0.07" effort="9" velocity="2"/>'),
        joint("to_flange", "link2", "flange", axis="0 0 0", kind="fixed", rest=""),
        '<joint name="finger1" type="prismatic"><parent link="flange"/><child link="left"/>'
        f'<origin xyz="0 0.03 0.05"/><axis xyz="0 1 0"/>{slide}</joint>',
        '<joint name="finger2" type="prismatic"><parent link="flange"/><child link="right"/>'
        f'<origin xyz="0 -0.03 0.05"/><axis xyz="0 -1 0"/>{slide}<mimic joint="finger1"/></joint>',
    )  # fmt: skip
    says = (
        "its mass is 0 kg: it is a mere frame -> <inertial> left out",
        "a fixed joint's axis is zero, which is harmless",
        'joint "finger2": follows joint "finger1" -> it gets no motor of its own',
    )
    return Export(urdf, says, ("joint1", "joint2", "finger1"))


def obj(root: Path) -> Export:
    """.obj beside the URDF in millimetres, inertias of no body, backslashes in the paths."""
    for name in ("a", "b", "c"):
        mesh(root / "obj_arm" / "geometry", f"{name}.obj", scale=1000.0)
    none = INERTIAL.format(mass=0.9, inertia='ixx="-0.002" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.0004"')
    urdf = write(
        root / "obj_arm" / "robot.urdf", "obj_arm",
        *(link(name, f"geometry\\{name}.obj", inertial=none) for name in ("a", "b", "c")),
        joint("one", "a", "b"), joint("two", "b", "c", axis="1 0 0"),
    )  # fmt: skip
    return Export(urdf.parent, ("are of no body -> that of its mesh at 0.9 kg", "it is in millimetres"), ("one", "two"))


def flat(root: Path) -> Export:
    """A sheet without volume among the meshes, a density of no material, a slide."""
    folder = root / "flat"
    for name in ("base", "mast", "carriage"):
        mesh(folder / "meshes", f"{name}.stl")
    sheet = trimesh.Trimesh([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]], [[0, 1, 2], [0, 2, 3]])
    (folder / "meshes" / "logo.stl").write_bytes(trimesh.exchange.stl.export_stl(sheet))
    label = '<visual><geometry><mesh filename="meshes/logo.stl"/></geometry></visual>'
    heavy = INERTIAL.format(mass=900.0, inertia='ixx="2" ixy="0" ixz="0" iyy="2" iyz="0" izz="0.4"')
    urdf = write(
        folder / "flat.urdf", "flat",
        link("base", "meshes/base.stl").replace("</link>", f"{label}</link>"),
        link("mast", "meshes/mast.stl", inertial=heavy), link("carriage", "meshes/carriage.stl"),
        joint("turn", "base", "mast", axis="0 0 1"),
        joint("lift", "mast", "carriage", axis="0 0 1", kind="prismatic",
              rest='<limit lower="0" upper="0.15" effort="20" velocity="0.1"/>'),
    )  # fmt: skip
    says = ('mesh "meshes/logo.stl" in <visual> bounds no volume -> left out', "no material has that density")
    return Export(urdf, says, ("turn", "lift"))


def degrees(root: Path) -> Export:
    """An onshape-like flat folder: limits in degrees, one joint without any, collision meshes alone."""
    folder = root / "degrees"
    for name in ("part_1", "part_2", "part_3"):
        mesh(folder, f"{name}.stl")
    touched = '<link name="part_3"><collision><geometry><mesh filename="part_3.stl"/></geometry></collision></link>'
    urdf = write(
        folder / "robot.urdf", "degrees",
        link("part_1", "part_1.stl"), link("part_2", "package://part_2.stl", collision=False), touched,
        joint("dof1", "part_1", "part_2", rest='<limit lower="-180" upper="180" effort="1" velocity="90"/>'),
        joint("dof2", "part_2", "part_3", axis="1 0 0", rest=""),
    )  # fmt: skip
    says = (
        "its limits lack sense (lower -180, upper 180, velocity 90)",
        "its limits lack sense (lower missing, upper missing, velocity missing, effort missing)",
        'link "part_3": has a <collision>, but no <visual>',
    )
    return Export(urdf, says, ("dof1", "dof2"))


def workspace(root: Path) -> Export:
    """A colcon workspace's source: the URDF in one package, its meshes in another one beside it, six joints."""
    package(root / "src" / "six_description", "six_description")
    package(root / "src" / "six_meshes", "six_meshes")
    names = [f"link_{number}" for number in range(7)]
    for name in names:
        mesh(root / "src" / "six_meshes" / "stl", f"{name}.stl", length=0.12)
    axes: Sequence[str] = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
    write(
        root / "src" / "six_description" / "robots" / "six.urdf", "six",
        *(link(name, f"package://six_meshes/stl/{name}.stl") for name in names),
        *(joint(f"joint_{number}", names[number - 1], names[number], axis, z=0.15)
          for number, axis in enumerate(axes, 1)),
    )  # fmt: skip
    return Export(root / "src", (), tuple(f"joint_{number}" for number in range(1, 7)))


def hobby(root: Path) -> Export:
    """A desk arm: each joint has the name of its child link, and the first turns two discs 6 mm apart on one axis."""
    folder = root / "hobby"
    for name in ("base", "disc"):
        mesh(folder, f"{name}.stl", length=0.02)
    mesh(folder, "arm.stl")
    limit = '<limit lower="0.820304748437335" upper="2.5" effort="9" velocity="2"/>'
    hub = '<visual><origin xyz="0 0 0.003"/><geometry><cylinder radius="0.01" length="0.006"/></geometry></visual>'
    urdf = write(
        folder / "hobby.urdf", "hobby",
        link("base", "base.stl"), f'<link name="hub">{hub}</link>', link("disc", "disc.stl"), link("arm", "arm.stl"),
        joint("hub", "base", "hub", axis="0 0 1", z=0.02), joint("disc", "hub", "disc", axis="0 0 1", z=0.006),
        joint("arm", "disc", "arm", z=0.06, rest=limit),
    )  # fmt: skip
    return Export(urdf, (), ("hub", "disc", "arm"))


EXPORTS: tuple[Callable[[Path], Export], ...] = (
    solidworks, fusion, ros2, by_hand, obj, flat, degrees, workspace, hobby,
)  # fmt: skip
