"""What stands around the arm, what it carries, and what may touch what."""

from __future__ import annotations

from enum import StrEnum

from schemas.frames import Transform
from schemas.message import Message, Vector


class BoxShape(Message, frozen=True, kw_only=True, tag="box"):
    """A box around its origin."""

    size: Vector = ()  # (3,) [m] whole edges


class SphereShape(Message, frozen=True, kw_only=True, tag="sphere"):
    """A ball around its origin."""

    radius: float = 0.0  # [m]


class CylinderShape(Message, frozen=True, kw_only=True, tag="cylinder"):
    """A cylinder around its origin, its axis along z."""

    radius: float = 0.0  # [m]
    length: float = 0.0  # [m]


class PlaneShape(Message, frozen=True, kw_only=True, tag="plane"):
    """All that lies below z = 0 of its own frame."""


class MeshShape(Message, frozen=True, kw_only=True, tag="mesh"):
    """An STL file: a path relative to the project or the robot's folder, or its content."""

    path: str = ""
    data: bytes = b""  # of the file; used where `path` is empty
    scale: Vector = (1.0, 1.0, 1.0)  # file's units to m


Shape = BoxShape | SphereShape | CylinderShape | PlaneShape | MeshShape


class SceneObject(Message, frozen=True, kw_only=True):
    """One object; `pose` is in `frame`, which is a link it is attached to or the base (empty)."""

    name: str = ""
    shape: Shape = BoxShape()
    pose: Transform = Transform()
    frame: str = ""
    attached: bool = False  # it moves with the link `frame`
    touch_links: tuple[str, ...] = ()  # links that an attached object may touch, besides the one it is attached to
    padding: float = 0.0  # [m] kept around it, besides the planner's clearance


class AllowedPair(Message, frozen=True, kw_only=True):
    """Two links or objects that may touch, besides those of the SRDF; "*" is any."""

    first: str = ""
    second: str = ""


class PlanningScene(Message, frozen=True, kw_only=True):
    """All of it; latched, and kept by the planner over a restart."""

    stamp: int = 0  # [ns] UNIX time of the last change
    version: int = 0  # +1 with every change
    epoch: int = 0  # random, drawn where versions begin: no two scenes share both; 0: before the first change
    objects: tuple[SceneObject, ...] = ()
    allowed: tuple[AllowedPair, ...] = ()


class SceneAction(StrEnum):
    """What is to be done with a scene."""

    ADD = "add"  # `object`; one of that name is replaced
    REMOVE = "remove"  # `name`
    MOVE = "move"  # `name` to `object.pose` in `object.frame`
    RESIZE = "resize"  # `name` to `object.shape`
    ATTACH = "attach"  # `name` to the link `object.frame`, where it is now; `object.touch_links`
    DETACH = "detach"  # `name`, left where it is now
    ALLOW = "allow"  # `pair`
    DISALLOW = "disallow"  # `pair`
    REPLACE = "replace"  # all by `scene`
    CLEAR = "clear"


class SceneRequest(Message, frozen=True, kw_only=True):
    """A change."""

    action: SceneAction = SceneAction.ADD
    name: str = ""
    object: SceneObject = SceneObject()
    pair: AllowedPair = AllowedPair()
    scene: PlanningScene = PlanningScene()


class SceneResponse(Message, frozen=True, kw_only=True):
    """Whether the scene is changed now."""

    accepted: bool = False
    reason: str = ""
    version: int = 0


class Contact(Message, frozen=True, kw_only=True):
    """Two links or objects that touch, or are nearer than the clearance."""

    first: str = ""
    second: str = ""
    distance: float = 0.0  # [m] negative inside
    point: Vector = ()  # (3,) [m] in the base frame; empty where it is not known


class Contacts(Message, frozen=True, kw_only=True):
    """What touches in the configuration that was refused last, or now; empty when nothing does."""

    stamp: int = 0  # [ns] UNIX time
    name: tuple[str, ...] = ()
    position: Vector = ()  # [rad] or [m] the configuration
    contacts: tuple[Contact, ...] = ()
