"""The planning scene: the objects around the arm, what it carries, and which pairs may touch."""

from __future__ import annotations

from gemelo.schemas.frames import Transform
from gemelo.schemas.message import Message, Vector
from gemelo.schemas.reasons import Reason


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
    """An STL file: a path relative to the project or the robot's folder, or its content, or the digest of that."""

    path: str = ""
    data: bytes = b""  # of the file; used where `path` is empty
    scale: Vector = (1.0, 1.0, 1.0)  # file's units to m
    digest: str = ""  # of the file (scene_meshes.py), whose content is a `SceneMesh`; where `path` and `data` are empty
    size: int = 0  # [bytes] of that file


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
    gripped: bool = False  # attached because the gripper has closed on it: it is detached when that opens


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


class SceneMesh(Message, frozen=True, kw_only=True):
    """The file of a mesh that the scene names by its digest; latched, on a key of its own while the scene does."""

    digest: str = ""
    data: bytes = b""


class SceneAdd(Message, frozen=True, kw_only=True, tag="add"):
    """Put an object into the scene; one of its name is replaced."""

    object: SceneObject = SceneObject()


class SceneRemove(Message, frozen=True, kw_only=True, tag="remove"):
    """Take the object `name` out of the scene, with what was allowed to touch it."""

    name: str = ""


class SceneMove(Message, frozen=True, kw_only=True, tag="move"):
    """Place the object `name` at `pose` in `frame` (empty: the base); an attached one stays attached."""

    name: str = ""
    pose: Transform = Transform()
    frame: str = ""


class SceneResize(Message, frozen=True, kw_only=True, tag="resize"):
    """Give the object `name` another shape."""

    name: str = ""
    shape: Shape = BoxShape()


class SceneAttach(Message, frozen=True, kw_only=True, tag="attach"):
    """Attach the object `name` to `link`, where it is now; it may touch `touch_links` besides that link."""

    name: str = ""
    link: str = ""
    touch_links: tuple[str, ...] = ()


class SceneDetach(Message, frozen=True, kw_only=True, tag="detach"):
    """Detach the object `name`; it stays where it is now."""

    name: str = ""


class SceneGrip(Message, frozen=True, kw_only=True, tag="grip"):
    """Attach what stands between the gripper's jaws to the tool, if anything does; the answer names it."""

    look: bool = False  # only say what it is
    opening: float | None = None  # [m] between the jaws now; None: as the gripper's state has it


class SceneRelease(Message, frozen=True, kw_only=True, tag="release"):
    """Detach what `SceneGrip` has attached; it stays where it is now."""

    opening: float | None = None  # [m] between the jaws now; None: as the gripper's state has it


class SceneAllow(Message, frozen=True, kw_only=True, tag="allow"):
    """Let a pair touch."""

    pair: AllowedPair = AllowedPair()


class SceneDisallow(Message, frozen=True, kw_only=True, tag="disallow"):
    """No longer let a pair touch that the scene allowed."""

    pair: AllowedPair = AllowedPair()


class SceneReplace(Message, frozen=True, kw_only=True, tag="replace"):
    """Replace all objects and allowed pairs by those of `scene`."""

    scene: PlanningScene = PlanningScene()


class SceneClear(Message, frozen=True, kw_only=True, tag="clear"):
    """Remove all objects and allowed pairs."""


SceneEdit = (
    SceneAdd
    | SceneRemove
    | SceneMove
    | SceneResize
    | SceneAttach
    | SceneDetach
    | SceneGrip
    | SceneRelease
    | SceneAllow
    | SceneDisallow
    | SceneReplace
    | SceneClear
)


class SceneRequest(Message, frozen=True, kw_only=True):
    """One change of the scene."""

    edit: SceneEdit = SceneAdd()


class SceneResponse(Message, frozen=True, kw_only=True):
    """Whether the scene is changed now."""

    accepted: bool = False
    reason: str = ""
    version: int = 0
    name: str = ""  # of SceneGrip and SceneRelease: the object; empty if there is none
    width: float = 0.0  # [m] of that object between the jaws
    why: Reason | None = None  # `reason` as data


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
