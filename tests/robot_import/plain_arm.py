"""A small arm of boxes and meshes as the tests of strangers' descriptions change it: three joints, 0.2 m apart."""

from __future__ import annotations

from pathlib import Path

import trimesh

from tests.robot_import.exports import write

LINKS = ("base", "upper", "fore", "hand")
APART = 0.2  # [m]
AXES = {"j1": "0 0 1", "j2": "0 1 0", "j3": "0 1 0"}
LIMIT = '<limit lower="-2" upper="2" effort="10" velocity="1"/>'
ROD = f'<geometry><box size="0.05 0.05 {APART}"/></geometry>'


def body(tag: str, geometry: str = ROD, xyz: str = "0 0 0.1") -> str:
    """A <visual> or a <collision>."""
    return f'<{tag}><origin xyz="{xyz}"/>{geometry}</{tag}>'


BOTH = body("visual") + body("collision")


def part(name: str, content: str = BOTH) -> str:
    """A link."""
    return f'<link name="{name}">{content}</link>'


def hinge(name: str, parent: str, child: str, rest: str = LIMIT, apart: float = APART, kind: str = "revolute") -> str:
    """A joint at the end of its parent."""
    axis = AXES.get(name, "0 1 0")
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 {apart}"/><axis xyz="{axis}"/>{rest}</joint>'
    )


def hinges(apart: float = APART, **rest: str) -> str:
    """The three joints, with what stands in some of them in place of `LIMIT`."""
    ends = zip(AXES, LINKS[:-1], LINKS[1:], strict=True)
    return "\n".join(hinge(name, one, other, rest.get(name, LIMIT), apart) for name, one, other in ends)


def boxes(**content: str) -> str:
    """The four links, with what stands in some of them in place of `BOTH`."""
    return "\n".join(part(name, content.get(name, BOTH)) for name in LINKS)


def arm(folder: Path, *parts: str, name: str = "arm") -> Path:
    """The URDF of these lines, else of the arm as it is."""
    return write(folder / "arm.urdf", name, *(parts or (boxes(), hinges())))


def stl(file: Path, size: tuple[float, float, float] = (0.05, 0.05, APART), at: tuple[float, ...] = (0, 0, 0)) -> Path:
    """A box that stands on the place `at`, in whatever unit."""
    file.parent.mkdir(parents=True, exist_ok=True)
    solid = trimesh.creation.box(size)
    solid.apply_translation((at[0], at[1], at[2] + size[2] / 2.0))
    file.write_bytes(trimesh.exchange.stl.export_stl(solid))
    return file


def meshed(name: str, scale: str = "", tags: tuple[str, ...] = ("visual", "collision"), xyz: str = "0 0 0") -> str:
    """What a link has that is drawn and touched by one mesh file."""
    written = f' scale="{scale}"' if scale else ""
    return "".join(body(tag, f'<geometry><mesh filename="{name}"{written}/></geometry>', xyz) for tag in tags)
