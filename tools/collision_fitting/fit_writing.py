"""Fitted shapes as elements of a URDF, written into it in place of what is there, and held against the meshes again."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import trimesh

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.arm.model.urdf import Triple
from gemelo.libraries.arm.model.urdf_edit import with_collisions
from gemelo.schemas.reasons import Reason, because
from gemelo.services.planner.collision_geometry.link_shapes import link_shapes
from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind
from gemelo.tools.collision_fitting.excess import depth_in
from gemelo.tools.collision_fitting.link_meshes import HULLS
from gemelo.tools.collision_fitting.mesh_fit import LinkFit

# Tuning constants: chosen, where a line does not say measured or standard.
OUTSIDE = 1e-6  # [m] that a corner may be outside the shapes as they are loaded again: a rounding


def elements_of(fit: LinkFit) -> list[str]:
    """As <collision> elements; URDF knows no capsule, so that it and a plate are three."""
    numbered = enumerate(fit.shapes, 1)
    return [
        _element(shape, each.origin.rpy, hull_file(fit.link, number))
        for number, each in numbered
        for shape in each.shapes
    ]


def hull_file(link: str, number: int) -> str:
    """Where a link's shape of this number is if it is a hull, from the URDF on."""
    return f"{HULLS}/{_file_name(link)}.{number}.stl"


def _file_name(link: str) -> str:
    return re.sub(r"[^A-Za-z0-9_-]", lambda found: f"-{ord(found[0]):x}-", link)


def _element(shape: CollisionShape, rpy: Triple, file: str) -> str:
    origin = f'<origin xyz="{_words(shape.pose[0])}" rpy="{_words(rpy)}"/>'
    return f"<collision>\n  {origin}\n  <geometry>{_geometry(shape, file)}</geometry>\n</collision>"


def _geometry(shape: CollisionShape, file: str) -> str:
    match shape.kind:
        case ShapeKind.HULL:
            return f'<mesh filename="{file}"/>'
        case ShapeKind.BOX:
            return f'<box size="{_words(shape.size)}"/>'
        case ShapeKind.CYLINDER:
            return f'<cylinder radius="{_words(shape.size[:1])}" length="{_words(shape.size[1:])}"/>'
    return f'<sphere radius="{_words(shape.size)}"/>'


def _words(values: Sequence[float]) -> str:
    return " ".join(f"{round(value, 9) + 0.0:.9g}" for value in values)


def write_fits(arm: ArmDescription, fits: Sequence[LinkFit]) -> ArmDescription:
    """Puts the shapes into the URDF in place of those that the links have, hulls into files beside it, and returns the
    arm, loaded again.

    Raises `DescriptionError` where not every shape is there then or a corner of a mesh is outside them, and the files
    are as they were. Raises OSError where one cannot be read or written.
    """
    wanted = {fit.link: elements_of(fit) for fit in fits}
    before = arm.urdf_path.read_bytes()
    try:
        after = with_collisions(before.decode("utf-8"), wanted).encode("utf-8")
    except ValueError as error:
        raise DescriptionError(because("fit.urdf", file=str(arm.urdf_path), error=str(error))) from error
    with _restored(arm.urdf_path.parent / HULLS):
        _write_hulls(arm.urdf_path.parent, fits)
        arm.urdf_path.write_bytes(after)
        try:
            changed = load_arm(arm.folder)
            _require_there(changed, fits, wanted)
        except ValueError:
            arm.urdf_path.write_bytes(before)
            raise
    return changed


def _write_hulls(folder: Path, fits: Sequence[LinkFit]) -> None:
    """The files of these links' hulls, and no others of these links."""
    (folder / HULLS).mkdir(parents=True, exist_ok=True)
    for fit in fits:
        for old in (folder / HULLS).glob(f"{_file_name(fit.link)}.[0-9]*.stl"):
            old.unlink()
        for number, each in enumerate(fit.shapes, 1):
            for mesh in (shape.mesh for shape in each.shapes if shape.mesh is not None):
                whole = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
                whole.export(folder / hull_file(fit.link, number))
    if not any((folder / HULLS).iterdir()):
        (folder / HULLS).rmdir()


@contextmanager
def _restored(folder: Path) -> Iterator[None]:
    """The files in `folder` are as they were if the block raises."""
    before = {path: path.read_bytes() for path in folder.glob("*.stl")}
    try:
        yield
    except BaseException:
        for path in folder.glob("*.stl"):
            path.unlink()
        for path, content in before.items():
            path.write_bytes(content)
        raise


def touching_states(arm: ArmDescription) -> list[Reason]:
    """The named states in which two links touch that are no neighbours: shapes hold more than meshes do."""
    own = Kinematics(arm).collisions
    neighbours = {frozenset((joint.parent, joint.child)) for joint in arm.model.joints}
    return [
        because("fit.touch", state=state, first=pair[0], second=pair[1])
        for state, configuration in arm.named_states.items()
        for pair in own.pairs_within(configuration)
        if frozenset(pair) not in neighbours
    ]


def _require_there(arm: ArmDescription, fits: Sequence[LinkFit], wanted: dict[str, list[str]]) -> None:
    loaded = link_shapes(arm)
    for fit in fits:
        shapes = loaded.get(fit.link, ())
        if len(shapes) != len(wanted[fit.link]):
            counts = {"count": len(shapes), "wanted": len(wanted[fit.link])}
            raise DescriptionError(because("fit.shapes", file=str(arm.urdf_path), link=fit.link, **counts))
        deepest = depth_in(shapes, fit.mesh.vertices)
        if deepest.min() < -OUTSIDE:
            outside = -1000.0 * float(deepest.min())
            raise DescriptionError(because("fit.outside", file=str(arm.urdf_path), link=fit.link, distance=outside))
