"""The world before the virtual camera: table, fixed tags, things, the arm with its jaws, and the planning scene. Pure.

It has a truth of its own: things stand where cell.toml puts them, move with the jaws that have closed on them, and fall
onto the table when they open. What a detector believes (objects of the scene with a thing's name) is never drawn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from gemelo.libraries.arm.cell.camera_file import MOUNT_BOARD
from gemelo.libraries.arm.cell.cell_file import Cell, grasp_width, height_of_frame
from gemelo.libraries.arm.cell.colours import RGB
from gemelo.libraries.arm.frames.transforms import (
    IDENTITY,
    Point,
    Rigid,
    compose,
    from_axis_angle,
    from_message,
    from_rpy,
    inverse,
    rotate,
)
from gemelo.libraries.arm.kinematics.chain import link_transforms
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.jaws import JAWS, jaw_edges, jaw_objects
from gemelo.schemas.cell import ColourThing, TagPlace, TagRecord, TagThing, Thing
from gemelo.schemas.gripper import GripperState
from gemelo.schemas.joints import JointState
from gemelo.schemas.scene import PlanningScene
from gemelo.services.camera.virtual.arm_solids import arm_solids, solid_of
from gemelo.services.camera.virtual.solids import Face, PosedSolid, box, tag

TABLE, WOOD, CARDBOARD, OBSTACLE, JAW = (158, 150, 138), (120, 86, 52), (186, 160, 120), (128, 134, 142), (40, 42, 46)
TABLE_HALF = 1.5  # [m]
SHEET = 1e-4  # [m] a printed tag is above what it lies on, so that it is drawn over it
CAUGHT = 0.0015  # [m] of the opening more than a thing's width, at which it is held
ALONG_JAW = 0.004  # [m] beyond the jaws within which they still catch a thing


@dataclass(frozen=True)
class GrippedThing:
    """A thing between the jaws: its pose in the tool frame ([m], quaternion)."""

    name: str
    tool_from_thing: Rigid
    width: float  # [m] of what is between the jaws


@dataclass(frozen=True, eq=False)
class WorldSnapshot:
    """Everything at one instant, poses in the base frame; two with equal `key` look the same."""

    solids: tuple[PosedSolid, ...]
    links: Mapping[str, Rigid]
    things: Mapping[str, Rigid]
    stamp: int  # [ns] UNIX time of the joint state by this host's clock; 0 where that is not known
    key: tuple[object, ...] = field(default=())


class CameraWorld:
    """Takes what the bus says of the arm and the scene; `snapshot` may be called from another thread."""

    def __init__(
        self, arm: ArmDescription, cell: Cell, to_own: Callable[[int], int | None] = lambda stamp: stamp
    ) -> None:
        """`to_own(stamp)` is a joint state's stamp by this host's clock, None while that is not known.

        Raises `DescriptionError` where the arm's URDF cannot be read.
        """
        self._arm, self._cell, self._to_own = arm, cell, to_own
        self._links = arm_solids(arm)
        self._parts = {thing.name: thing_faces(thing) for thing in cell.things}
        self._fixed = fixed_solids(cell)
        self._tags = [(each, tag(each.family, each.id, each.size).faces) for each in cell.tags]
        self._joints = JointState(name=arm.joint_names, position=(0.0,) * len(arm.joints))
        self._opening = arm.gripper.open if arm.gripper is not None else 0.0
        self._scene = PlanningScene()
        self._held: GrippedThing | None = None
        self._things: dict[str, Rigid] = {
            thing.name: (thing.position, from_rpy(0.0, 0.0, thing.yaw))
            for thing in cell.things
            if thing.position is not None
        }

    def on_joint_state(self, state: JointState) -> None:
        """A state with other joints than the arm's is left out."""
        if set(state.name) >= set(self._arm.joint_names) and len(state.position) == len(state.name):
            self._joints = state

    def on_scene(self, scene: PlanningScene) -> None:
        self._scene = scene

    def on_gripper_state(self, state: GripperState) -> None:
        """Jaws that are as near as a thing is wide hold it; jaws that open wider let it fall onto the table."""
        if not state.known or self._arm.gripper is None:
            return
        before, self._opening = self._opening, state.position
        tool = self._link_poses()[self._arm.tool_frame]
        if self._held is None:
            self._held = self._caught(tool, before)
        elif state.position > self._held.width + CAUGHT:
            released = compose(tool, self._held.tool_from_thing)
            self._things = {**self._things, self._held.name: self._fallen(self._held.name, released)}
            self._held = None

    def put(self, name: str, pose: Rigid) -> None:
        """Sets a thing somewhere ([m], quaternion), as a hand would."""
        self._cell.thing(name)
        if self._held is not None and self._held.name == name:
            self._held = None
        self._things = {**self._things, name: pose}

    def snapshot(self) -> WorldSnapshot:
        """What there is now."""
        joints, scene, held, things, opening = self._joints, self._scene, self._held, self._things, self._opening
        links = self._link_poses(joints)
        if held is not None:
            things = {**things, held.name: compose(links[self._arm.tool_frame], held.tool_from_thing)}
        solids = [*self._fixed]
        solids += [_at(solid, links[name]) for name, parts in self._links.items() for solid in parts if name in links]
        solids += [PosedSolid(faces, tag_pose(record, links)) for record, faces in self._tags]
        solids += [PosedSolid(self._parts[name], pose) for name, pose in things.items()]
        solids += self._jaws(links, opening)
        solids += self._obstacles(links, scene)
        key = (joints.position, scene.version, scene.epoch, opening, tuple(things.items()))
        return WorldSnapshot(tuple(solids), links, things, self._to_own(joints.stamp) or 0, key)

    def _link_poses(self, joints: JointState | None = None) -> dict[str, Rigid]:
        """In the base frame."""
        joints = self._joints if joints is None else joints
        poses = link_transforms(self._arm.model, dict(zip(joints.name, joints.position, strict=True)))
        base = poses[self._arm.base_frame]
        if base == IDENTITY:
            return poses
        return {name: compose(inverse(base), pose) for name, pose in poses.items()}

    def _jaws(self, links: Mapping[str, Rigid], opening: float) -> list[PosedSolid]:
        found = []
        for each in jaw_objects(self._arm, opening):
            pose = compose(links[each.frame], from_message(each.pose))
            solid = solid_of(each.shape, JAW, pose)
            found += [solid] if solid is not None else []
        return found

    def _obstacles(self, links: Mapping[str, Rigid], scene: PlanningScene) -> list[PosedSolid]:
        """The scene's objects, without what is drawn by itself: things, the jaws, and tags on the arm."""
        own = {*self._parts, *JAWS, MOUNT_BOARD}
        found = []
        for each in scene.objects:
            frame = links.get(each.frame, IDENTITY) if each.frame else IDENTITY
            if each.name not in own:
                solid = solid_of(each.shape, OBSTACLE, compose(frame, from_message(each.pose)), self._arm.folder)
                found += [solid] if solid is not None else []
        return found

    def _caught(self, tool: Rigid, before: float) -> GrippedThing | None:
        """The thing on which the jaws, `before` [m] apart, have just closed: they centre it."""
        assert self._arm.gripper is not None
        along, _, beyond = jaw_edges(self._arm.gripper)
        for name, pose in self._things.items():
            thing = self._cell.thing(name)
            local = compose(inverse(tool), pose)
            x, y, z = compose(local, (thing.grasp_offset, IDENTITY[1]))[0]
            is_between = abs(x) <= along / 2.0 + ALONG_JAW and abs(y) <= self._arm.gripper.open / 2.0
            is_reached = -ALONG_JAW <= z <= beyond + ALONG_JAW
            width = width_across(thing, local)
            if is_between and is_reached and self._opening <= width + CAUGHT < before:
                (px, py, pz), turn = local
                return GrippedThing(name, ((px, py - y, pz), turn), width)
        return None

    def _fallen(self, name: str, pose: Rigid) -> Rigid:
        """Upright on the table, turned as it was about z."""
        thing = self._cell.thing(name)
        ahead = rotate(pose[1], (1.0, 0.0, 0.0))
        position: Point = (pose[0][0], pose[0][1], (self._cell.table or 0.0) + height_of_frame(thing))
        return position, from_axis_angle((0.0, 0.0, 1.0), math.atan2(ahead[1], ahead[0]))


def width_across(thing: Thing, tool_from_thing: Rigid) -> float:
    """[m] between jaws that close along the tool's y: the side of the thing that is nearest to that way."""
    if thing.grasp_width is not None or thing.box is None:
        return grasp_width(thing)
    along_x = abs(rotate(tool_from_thing[1], (1.0, 0.0, 0.0))[1])
    along_y = abs(rotate(tool_from_thing[1], (0.0, 1.0, 0.0))[1])
    return thing.box[0] if along_x > along_y else thing.box[1]


def tag_pose(record: TagRecord, links: Mapping[str, Rigid]) -> Rigid:
    """In the base frame, as the poses of the `links` are."""
    local: Rigid = (record.position, from_rpy(*record.rpy))
    return compose(links[record.parent], local) if record.parent else local


def thing_faces(thing: Thing) -> tuple[Face, ...]:
    """The faces of a thing in its own frame."""
    if isinstance(thing, TagThing):
        printed = tag(thing.family, thing.id, thing.size).faces
        if thing.box is None:
            return printed
        x, y, z = thing.box
        body = box((x, y, z), CARDBOARD).faces
        return (*printed, *(face.moved((0.0, 0.0, -z / 2.0 - SHEET)) for face in body))
    return box(thing.box, RGB[thing.colour] if isinstance(thing, ColourThing) else WOOD).faces


def fixed_solids(cell: Cell) -> tuple[PosedSolid, ...]:
    """The table, a little below its height so that what is printed lies on it, and the tags of places."""
    found = []
    if cell.table is not None:
        h, z = TABLE_HALF, cell.table - SHEET
        corners = np.array([[-h, -h, z], [h, -h, z], [h, h, z], [-h, h, z]])
        found.append(PosedSolid((Face(corners, TABLE),)))
    places = [each for each in cell.places if isinstance(each, TagPlace)]
    found += [
        tag(each.family, each.id, each.size, (each.position, from_rpy(0.0, 0.0, each.yaw)))
        for each in places
        if each.position is not None
    ]
    return tuple(found)


def _at(solid: PosedSolid, pose: Rigid) -> PosedSolid:
    return PosedSolid(solid.faces, compose(pose, solid.pose))
