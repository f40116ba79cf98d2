"""`cell.toml` as types: the cameras, things and places around the arm. Read by `gemelo.libraries.arm.cell`.

Everything is SI, positions are in the arm's base frame unless `parent` names a link. `camera.toml` beside it holds what
was measured of each camera: it is written by `gemelo camera calibrate` and `mount` only, and wins over what is here.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import msgspec
from msgspec import Meta

from gemelo.schemas.message import Message
from gemelo.schemas.robot_record import Edges, NotNegative, Positive

CellName = Annotated[str, Meta(pattern="^[a-z][a-z0-9_]*$")]  # a camera's is part of a key on the bus
Point = tuple[float, float, float]  # [m]
Angles = tuple[float, float, float]  # [rad] roll, pitch, yaw about fixed axes, as in URDF
TagNumber = Annotated[int, Meta(ge=0, le=4095)]
Pixels = Annotated[int, Meta(ge=32, le=4096)]
ImageSize = tuple[Pixels, Pixels]  # width, height
FieldOfView = Annotated[float, Meta(ge=0.17, le=2.6)]  # [rad]
Rate = Annotated[float, Meta(gt=0.0, le=120.0)]  # [Hz]
DEFAULT_FIELD_OF_VIEW = 1.047  # [rad] of a common webcam, across the image


class CellRecord(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of cell.toml; an unknown key is an error."""


class TagFamily(StrEnum):
    """The dictionaries of tags that are drawn and found."""

    APRILTAG_36H11 = "apriltag_36h11"
    APRILTAG_25H9 = "apriltag_25h9"
    ARUCO_4X4_50 = "aruco_4x4_50"
    ARUCO_5X5_100 = "aruco_5x5_100"
    ARUCO_6X6_250 = "aruco_6x6_250"


class Colour(StrEnum):
    """The colours that a thing can be told by."""

    RED = "red"
    ORANGE = "orange"
    YELLOW = "yellow"
    GREEN = "green"
    BLUE = "blue"
    PURPLE = "purple"


class V4l2Source(CellRecord, frozen=True, kw_only=True, tag_field="kind", tag="v4l2"):
    """A camera of Linux. Focus and exposure are in the driver's own units; what it refuses is said by name."""

    device: str  # best a path of /dev/v4l/by-id, which stays when another camera is plugged in
    focus: NotNegative | None = None  # None: held where it is, where the camera has a focus at all
    exposure: Positive | None = None  # None: the camera's automatic


class FolderSource(CellRecord, frozen=True, kw_only=True, tag_field="kind", tag="folder"):
    """The images of a folder, by name, one after the other."""

    path: str  # relative to the cell file
    loop: bool = True


class FileSource(CellRecord, frozen=True, kw_only=True, tag_field="kind", tag="file"):
    """A video, or one image again and again."""

    path: str  # relative to the cell file
    loop: bool = True


class VirtualSource(CellRecord, frozen=True, kw_only=True, tag_field="kind", tag="virtual"):
    """Renders the cell, the arm and the planning scene as a camera there would see them."""

    distortion: tuple[float, ...] = ()  # k1, k2, p1, p2, k3 of OpenCV's model; empty: none
    blur: NotNegative = 0.6  # [px] standard deviation
    noise: NotNegative = 3.0  # standard deviation, of 255
    samples: Annotated[int, Meta(ge=1, le=4)] = 2  # along each side of a pixel


Source = V4l2Source | FolderSource | FileSource | VirtualSource


class CameraRecord(CellRecord, frozen=True, kw_only=True):
    """One camera. Where it stands is assumed from here until it is measured; of a virtual one it is exact."""

    name: CellName
    source: Source
    size: ImageSize = (640, 480)  # [px]
    fps: Rate = 15.0
    parent: str = ""  # the link that carries it; empty: it stands, and positions are in the base frame
    position: Point = (0.0, 0.0, 0.6)
    look_at: Point = (0.0, 0.0, 0.0)
    roll: float = (
        0.0  # [rad] about its line of sight; at 0 the parent's z is up in the image, or x where it looks along z
    )
    field_of_view: FieldOfView = DEFAULT_FIELD_OF_VIEW  # across the image: assumed until it is calibrated


class TagRecord(CellRecord, frozen=True, kw_only=True):
    """A tag that is no thing: fixed on the table, or on a link. Its frame: x right and y up as printed, z out of it."""

    id: TagNumber
    size: Positive  # [m] the edge of the black square
    family: TagFamily = TagFamily.APRILTAG_36H11
    parent: str = ""  # the link that carries it; empty: the base
    position: Point = (0.0, 0.0, 0.0)
    rpy: Angles = (0.0, 0.0, 0.0)


class ThingRecord(CellRecord, frozen=True, kw_only=True):
    """What every thing has. The frame of a box is its centre, z up; that of a tag is the tag's."""

    name: CellName
    grasp_offset: Point = (0.0, 0.0, 0.0)  # in the thing's frame: the point that comes between the jaws
    grasp_width: Positive | None = None  # [m] between the jaws that hold it; None: what the box or the tag measures
    position: Point | None = None  # where a virtual camera finds it at first; None: nowhere
    yaw: float = 0.0  # [rad] about z, the same


class TagThing(ThingRecord, frozen=True, kw_only=True, tag_field="kind", tag="tag"):
    """A thing with a tag in the middle of its upper face, or a flat one where it has no `box`."""

    id: TagNumber
    size: Positive  # [m] the edge of the black square
    family: TagFamily = TagFamily.APRILTAG_36H11
    box: Edges | None = None  # [m] its body, below the tag


class BoxThing(ThingRecord, frozen=True, kw_only=True, tag_field="kind", tag="box"):
    """A box of known size that stands out from the table."""

    box: Edges  # [m]


class ColourThing(ThingRecord, frozen=True, kw_only=True, tag_field="kind", tag="colour"):
    """A box of known size, told by its colour."""

    colour: Colour
    box: Edges  # [m]


class OnnxThing(ThingRecord, frozen=True, kw_only=True, tag_field="kind", tag="onnx"):
    """A class of the user's own model, in the layout of YOLO."""

    model: str  # an .onnx file, relative to the cell file
    label: Annotated[int, Meta(ge=0)] | Annotated[str, Meta(min_length=1)]  # number of the class, or its name
    box: Edges  # [m] about
    threshold: Annotated[float, Meta(gt=0.0, lt=1.0)] = 0.5
    input: Annotated[int, Meta(ge=32, le=4096)] = 640  # [px] edge of the square image that it was exported with


Thing = TagThing | BoxThing | ColourThing | OnnxThing


class PosePlace(CellRecord, frozen=True, kw_only=True, tag_field="kind", tag="pose"):
    """A place that stays where it is."""

    name: CellName
    position: Point  # where the point between the jaws lets go
    yaw: float | None = None  # [rad] of the thing's turn about z; None: any


class TagPlace(CellRecord, frozen=True, kw_only=True, tag_field="kind", tag="tag"):
    """A place that a tag marks, which may be moved."""

    name: CellName
    id: TagNumber
    size: Positive  # [m] the edge of the black square
    family: TagFamily = TagFamily.APRILTAG_36H11
    offset: Point = (0.0, 0.0, 0.0)  # in the tag's frame: where the point between the jaws lets go
    position: Point | None = None  # of the tag, where a virtual camera finds it; None: nowhere
    yaw: float = 0.0  # [rad] the same


Place = PosePlace | TagPlace


class CellFile(CellRecord, frozen=True, kw_only=True):
    """All of cell.toml."""

    camera: tuple[CameraRecord, ...] = ()
    tag: tuple[TagRecord, ...] = ()
    thing: tuple[Thing, ...] = ()
    place: tuple[Place, ...] = ()
    table: float | None = 0.0  # [m] height of the table's plane in the base frame


class Calibration(CellRecord, frozen=True, kw_only=True):
    """The lens of one camera, as measured."""

    size: ImageSize  # [px] of the images that were measured
    intrinsics: tuple[float, ...]  # [px] (9,) the matrix K (3, 3) row by row
    distortion: tuple[float, ...] = ()  # k1, k2, p1, p2, k3
    held_out: NotNegative = 0.0  # [px] median reprojection error of shots that took no part
    focal_sigma: NotNegative = 0.0  # [px] standard deviation of the focal length
    date: str = ""  # ISO 8601


class Mount(CellRecord, frozen=True, kw_only=True):
    """Where one camera stands, as measured: the pose of its optical frame in `parent`."""

    parent: str  # the base frame or a link
    position: Point
    rotation: tuple[float, float, float, float]  # unit quaternion (x, y, z, w)
    held_out: NotNegative = 0.0  # [m] median error of points that took no part
    date: str = ""  # ISO 8601


class MeasuredCamera(CellRecord, frozen=True, kw_only=True):
    """What the wizard has measured of one camera."""

    name: CellName
    calibration: Calibration | None = None
    mount: Mount | None = None


class CameraFile(CellRecord, frozen=True, kw_only=True):
    """All of camera.toml."""

    camera: tuple[MeasuredCamera, ...] = ()


class CellTexts(Message, frozen=True, kw_only=True):
    """A cell as it travels over the bus: the texts of its files, for whoever does not have them."""

    path: str = ""  # of cell.toml on the host of the process `camera`; empty: the twin was started without a cell
    cell: str = ""  # cell.toml
    cameras: str = ""  # camera.toml beside it; empty: nothing is measured
