"""A recording in Foxglove: the fields of its published schemas, and the arm where the frames put it."""

import json
import struct
from pathlib import Path

import jsonschema
import pytest
from mcap.reader import make_reader

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.arm.model.urdf import JointKind
from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.mcap_file import McapFile
from gemelo.schemas.frames import FrameTransform, FrameTransforms, Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.scene import BoxShape, CylinderShape, MeshShape, PlaneShape, PlanningScene, SceneObject, SphereShape
from gemelo.schemas.system import LogLevel, LogRecord
from gemelo.schemas.topics import DESCRIPTION, FRAMES, LOG, SCENE, STATIC_FRAMES
from gemelo.services.state_publisher.core import StatePublisher
from gemelo.services.state_publisher.main import describe

ROOT = Path(__file__).parents[2]
START = 1_795_000_000_123_456_789
NUMBER, TEXT, WHOLE, TRUTH = {"type": "number"}, {"type": "string"}, {"type": "integer"}, {"type": "boolean"}


def record(**fields):
    """A JSON schema of an object that must have all of these fields, and no others."""
    return {"type": "object", "properties": fields, "required": list(fields), "additionalProperties": False}


def many(item):
    return {"type": "array", "items": item}


# The published definitions (foxglove-sdk, schemas/jsonschema, MIT licence), their required fields, written out here so
# that ours are not held against themselves.
TIME = record(sec={"type": "integer", "minimum": 0}, nsec={"type": "integer", "minimum": 0, "maximum": 999_999_999})
DURATION = record(sec=WHOLE, nsec={"type": "integer", "minimum": 0, "maximum": 999_999_999})
VECTOR3 = record(x=NUMBER, y=NUMBER, z=NUMBER)
QUATERNION = record(x=NUMBER, y=NUMBER, z=NUMBER, w=NUMBER)
POSE = record(position=VECTOR3, orientation=QUATERNION)
COLOR = record(r=NUMBER, g=NUMBER, b=NUMBER, a=NUMBER)
ENTITY = record(
    timestamp=TIME, frame_id=TEXT, id=TEXT, lifetime=DURATION, frame_locked=TRUTH,
    metadata=many(record(key=TEXT, value=TEXT)),
    arrows=many(record(pose=POSE, shaft_length=NUMBER, shaft_diameter=NUMBER, head_length=NUMBER, head_diameter=NUMBER,
                       color=COLOR)),
    cubes=many(record(pose=POSE, size=VECTOR3, color=COLOR)),
    spheres=many(record(pose=POSE, size=VECTOR3, color=COLOR)),
    cylinders=many(record(pose=POSE, size=VECTOR3, bottom_scale=NUMBER, top_scale=NUMBER, color=COLOR)),
    lines=many(record(type=WHOLE, pose=POSE, thickness=NUMBER, scale_invariant=TRUTH, points=many(VECTOR3), color=COLOR,
                      colors=many(COLOR), indices=many(WHOLE))),
    triangles=many(record(pose=POSE, points=many(VECTOR3), color=COLOR, colors=many(COLOR), indices=many(WHOLE))),
    texts=many(record(pose=POSE, billboard=TRUTH, font_size=NUMBER, scale_invariant=TRUTH, color=COLOR, text=TEXT)),
    models=many(record(pose=POSE, scale=VECTOR3, color=COLOR, override_color=TRUTH, url=TEXT, media_type=TEXT,
                       data=TEXT)),
)  # fmt: skip
PUBLISHED = {
    "foxglove.FrameTransforms": record(
        transforms=many(
            record(timestamp=TIME, parent_frame_id=TEXT, child_frame_id=TEXT, translation=VECTOR3, rotation=QUATERNION)
        )
    ),
    "foxglove.Log": record(timestamp=TIME, level={"enum": [0, 1, 2, 3, 4, 5]}, message=TEXT, name=TEXT, file=TEXT,
                           line={"type": "integer", "minimum": 0}),
    "foxglove.SceneUpdate": record(
        deletions=many(record(timestamp=TIME, type={"enum": [0, 1]}, id=TEXT)), entities=many(ENTITY)
    ),
}  # fmt: skip


@pytest.fixture(params=["rm1", "parol6"])
def arm(request):
    return load_arm(ROOT / "urdf" / request.param)


def written(path, entries):
    """The messages for Foxglove by their channels, each held against the published schema and the file's own."""
    file = McapFile(path, {})
    file.write([Entry(topic, message, START) for topic, message in entries])
    file.close()
    found = {}
    with path.open("rb") as content:
        for schema, channel, message in make_reader(content).iter_messages():
            if channel.topic.startswith("foxglove/"):
                data = json.loads(message.data)
                assert channel.message_encoding == "json"
                assert schema.encoding == "jsonschema"
                jsonschema.validate(data, PUBLISHED[schema.name])
                jsonschema.validate(data, json.loads(schema.data))
                found.setdefault(channel.topic, []).append(data)
    return found


def test_the_files_own_schemas_have_the_published_fields_and_require_what_is_always_there(tmp_path):
    file = McapFile(tmp_path / "a.mcap", {})
    file.close()
    with file.path.open("rb") as content:
        schemas = {each.name: json.loads(each.data) for each in make_reader(content).get_summary().schemas.values()}
    assert set(schemas) == set(PUBLISHED)
    for name, schema in schemas.items():
        assert set(schema["properties"]) == set(PUBLISHED[name]["properties"])
    entity = schemas["foxglove.SceneUpdate"]["properties"]["entities"]["items"]
    assert set(entity["properties"]) == set(ENTITY["properties"])


def test_every_link_of_the_arm_that_has_a_shape_hangs_on_a_frame_that_is_recorded(arm, tmp_path):
    publisher = StatePublisher(arm)
    names = [joint.name for joint in arm.model.joints if joint.kind is not JointKind.FIXED]
    moving = publisher.on_joint_state(JointState(stamp=START, name=tuple(names), position=(0.0,) * len(names))).frames
    found = written(
        tmp_path / "arm.mcap",
        [(DESCRIPTION, describe(arm)), (STATIC_FRAMES, publisher.static_frames(START)), (FRAMES, moving)],
    )
    (drawn,) = found["foxglove/arm"]
    links = {entity["frame_id"] for entity in drawn["entities"]}
    frames = [
        each for key in ("foxglove/frames", "foxglove/static_frames") for m in found[key] for each in m["transforms"]
    ]
    known = {each["child_frame_id"] for each in frames} | {each["parent_frame_id"] for each in frames}
    assert links <= known
    with_shapes = {link.name for link in arm.model.links if any(c.shape != "mesh" for c in link.collisions)}
    assert links == with_shapes
    assert len(links) >= 4
    assert all(entity["frame_locked"] for entity in drawn["entities"])


def test_a_frames_numbers_and_time_are_the_messages_own(tmp_path):
    transform = Transform(translation=(0.1, 0.2, 0.3), rotation=(0.0, 0.0, 0.6, 0.8))
    message = FrameTransforms(transforms=(FrameTransform(stamp=START, parent="a", child="b", transform=transform),))
    ((each,),) = [m["transforms"] for m in written(tmp_path / "f.mcap", [(FRAMES, message)])["foxglove/frames"]]
    assert each == {
        "timestamp": {"sec": 1_795_000_000, "nsec": 123_456_789}, "parent_frame_id": "a", "child_frame_id": "b",
        "translation": {"x": 0.1, "y": 0.2, "z": 0.3}, "rotation": {"x": 0.0, "y": 0.0, "z": 0.6, "w": 0.8},
    }  # fmt: skip


@pytest.mark.parametrize(("level", "number"), list(zip(LogLevel, (1, 2, 3, 4, 5), strict=True)))
def test_a_log_line_keeps_its_level(tmp_path, level, number):
    said = written(tmp_path / "l.mcap", [(LOG, LogRecord(stamp=START, node="planner", level=level, text="t"))])
    assert [(m["level"], m["name"], m["message"]) for m in said["foxglove/log"]] == [(number, "planner", "t")]


STL = b"\0" * 80 + (1).to_bytes(4, "little") + struct.pack(
    "<12f", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0) + b"\0\0"  # fmt: skip


def test_the_scene_is_drawn_anew_with_every_change_and_what_cannot_be_drawn_is_left_out(tmp_path):
    at = Transform(translation=(0.5, 0.0, 0.25))
    shapes = {
        "box": BoxShape(size=(0.1, 0.2, 0.3)), "ball": SphereShape(radius=0.05),
        "post": CylinderShape(radius=0.02, length=0.4), "table": PlaneShape(),
        "part": MeshShape(data=STL, scale=(0.5, 0.5, 0.5)), "file": MeshShape(path="part.stl"),
        "odd": BoxShape(size=(1.0,)),
    }  # fmt: skip
    objects = tuple(SceneObject(name=name, shape=shape, pose=at) for name, shape in shapes.items())
    carried = SceneObject(name="cup", shape=shapes["post"], frame="efector_link", attached=True)
    first, second = PlanningScene(stamp=START, objects=(*objects, carried)), PlanningScene(stamp=START + 1)
    full, empty = written(tmp_path / "s.mcap", [(SCENE, first), (SCENE, second)])["foxglove/scene"]
    entities = {each["id"].removeprefix("object "): each for each in full["entities"]}
    assert set(entities) == {"box", "ball", "post", "table", "part", "cup"}
    assert entities["box"]["cubes"][0]["size"] == {"x": 0.1, "y": 0.2, "z": 0.3}
    assert entities["ball"]["spheres"][0]["size"]["x"] == 0.1
    assert entities["post"]["cylinders"][0]["size"] == {"x": 0.04, "y": 0.04, "z": 0.4}
    assert len(entities["part"]["triangles"][0]["points"]) == 3
    assert max(p["x"] for p in entities["part"]["triangles"][0]["points"]) == 0.5
    assert entities["cup"]["frame_id"] == "efector_link"
    assert empty["entities"] == []
    assert [each["type"] for each in empty["deletions"]] == [1]
