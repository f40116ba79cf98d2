"""Our messages as Foxglove knows them, so that its 3D and log panels show the arm, the scene and the log. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from gemelo.libraries.recordings import foxglove_schemas as fox
from gemelo.libraries.recordings.channels import Channel, Entry, schema_of
from gemelo.libraries.recordings.foxglove_shapes import Drawn, drawn_links, drawn_object, pose_of
from gemelo.schemas.frames import FrameTransforms, RobotDescription
from gemelo.schemas.scene import PlanningScene, SceneMesh
from gemelo.schemas.scene_meshes import with_meshes
from gemelo.schemas.system import LogRecord

FRAMES, STATIC_FRAMES, LOG = "foxglove/frames", "foxglove/static_frames", "foxglove/log"
SCENE, ARM = "foxglove/scene", "foxglove/arm"
CAMERA, IMAGE = "foxglove/camera/{}", "image"  # of one camera, by its name; its images
KINDS: dict[str, type[fox.Record]] = {
    FRAMES: fox.FrameTransforms, STATIC_FRAMES: fox.FrameTransforms, LOG: fox.Log,
    SCENE: fox.SceneUpdate, ARM: fox.SceneUpdate,
}  # fmt: skip
LEVELS = {10: fox.LogLevel.DEBUG, 20: fox.LogLevel.INFO, 30: fox.LogLevel.WARNING, 40: fox.LogLevel.ERROR,
          50: fox.LogLevel.FATAL}  # fmt: skip
Derived = tuple[str, fox.Record]  # the channel, and the message


def channels() -> tuple[Channel, ...]:
    """The channels that every file has besides those of the topics."""
    about = "derived from {} for Foxglove; `gemelo bag play` leaves it out"
    return tuple(
        Channel(key, f"foxglove.{kind.__name__}", schema_of(kind), {"derived": about.format(key.rpartition("/")[2])})
        for key, kind in KINDS.items()
    )


@dataclass
class FoxgloveTwin:
    """Turns entries into Foxglove's messages; knows the base frame once it has heard the robot's description."""

    base: str = "base_link"
    scene: Entry | None = None
    meshes: dict[str, bytes] = field(default_factory=dict)  # by digest

    def derived(self, entry: Entry) -> Iterator[Derived]:
        """What `entry` is in Foxglove's words: nothing, or messages with their channels."""
        match entry.message:
            case FrameTransforms() as frames:
                yield STATIC_FRAMES if entry.topic.key == "static_frames" else FRAMES, _frames(frames)
            case LogRecord() as record:
                yield LOG, _log(record)
            case PlanningScene() as scene:
                self.scene = entry
                yield SCENE, _scene(with_meshes(scene, self.meshes), entry.stamp, self.base)
            case SceneMesh() as mesh:
                self.meshes[mesh.digest] = mesh.data
                if self.scene is not None:
                    yield from self.derived(self.scene)
            case RobotDescription() as description:
                yield from self._described(description, entry)

    def _described(self, description: RobotDescription, entry: Entry) -> Iterator[Derived]:
        self.base, links = drawn_links(description.urdf)
        at = fox.time_of(entry.stamp)
        entities = tuple(_entity(at, f"link {drawn.frame}", drawn) for drawn in links)
        yield ARM, fox.SceneUpdate(deletions=(_all(at),), entities=entities)
        if self.scene is not None:
            yield from self.derived(self.scene)


def _frames(message: FrameTransforms) -> fox.FrameTransforms:
    found = []
    for each in message.transforms:
        if len(each.transform.translation) == 3 and len(each.transform.rotation) == 4:
            pose = pose_of(each.transform.translation, each.transform.rotation)
            found.append(
                fox.FrameTransform(
                    timestamp=fox.time_of(each.stamp), parent_frame_id=each.parent, child_frame_id=each.child,
                    translation=pose.position, rotation=pose.orientation,
                )
            )  # fmt: skip
    return fox.FrameTransforms(transforms=tuple(found))


def _log(record: LogRecord) -> fox.Log:
    level = LEVELS.get(record.level, fox.LogLevel.UNKNOWN)
    return fox.Log(timestamp=fox.time_of(record.stamp), level=level, message=record.text, name=record.node)


def _all(at: fox.Time) -> fox.SceneEntityDeletion:
    return fox.SceneEntityDeletion(timestamp=at, type=fox.DeletionType.ALL, id="")


def _scene(scene: PlanningScene, stamp: int, base: str) -> fox.SceneUpdate:
    """The whole scene: what was there before goes."""
    at = fox.time_of(stamp)
    drawn = ((each.name, drawn_object(each, base)) for each in scene.objects)
    entities = tuple(_entity(at, f"object {name}", each) for name, each in drawn if each is not None)
    return fox.SceneUpdate(deletions=(_all(at),), entities=entities)


def _entity(at: fox.Time, name: str, drawn: Drawn) -> fox.SceneEntity:
    return fox.SceneEntity(
        timestamp=at, frame_id=drawn.frame, id=name, cubes=drawn.cubes, spheres=drawn.spheres,
        cylinders=drawn.cylinders, triangles=drawn.triangles,
    )  # fmt: skip
