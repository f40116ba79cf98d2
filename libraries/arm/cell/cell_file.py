"""cell.toml, read as strictly as robot.toml: every fault names the file, the line, the thing and the remedy."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import msgspec

from gemelo.libraries.arm.cell.camera_file import CAMERA_FILE, measured_of
from gemelo.libraries.arm.errors import Subject, nearest, wrong_file
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.arm.model.robot_file import line_of, read_robot_data, read_text
from gemelo.libraries.toml_lines import Where, type_mistake
from gemelo.schemas.cell import (
    CameraRecord,
    CellFile,
    CellTexts,
    FileSource,
    FolderSource,
    MeasuredCamera,
    OnnxThing,
    Place,
    Source,
    TagFamily,
    TagPlace,
    TagRecord,
    TagThing,
    Thing,
)
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.reasons import Reason, because, remedy

TAG_COUNTS = {
    TagFamily.APRILTAG_36H11: 587,
    TagFamily.APRILTAG_25H9: 35,
    TagFamily.ARUCO_4X4_50: 50,
    TagFamily.ARUCO_5X5_100: 100,
    TagFamily.ARUCO_6X6_250: 250,
}
NEAREST_LOOK = 0.01  # [m] a camera looks at a point at least as far away
KINDS = {
    "source": ("v4l2", "folder", "file", "virtual"),
    "thing": ("tag", "box", "colour", "onnx"),
    "place": ("pose", "tag"),
}

Fault = tuple[Where, Reason]  # where it stands, and what is wrong
Tagged = TagRecord | TagThing | TagPlace
N = TypeVar("N", bound=CameraRecord | Thing | Place)


@dataclass(frozen=True)
class Cell:
    """One cell: its file, and what was measured of its cameras."""

    path: Path  # of cell.toml
    cameras: tuple[CameraRecord, ...] = ()
    tags: tuple[TagRecord, ...] = ()
    things: tuple[Thing, ...] = ()
    places: tuple[Place, ...] = ()
    table: float | None = 0.0  # [m] height of the table's plane in the base frame
    measured: dict[str, MeasuredCamera] = field(default_factory=dict)  # by the camera's name

    def camera(self, name: str) -> CameraRecord:
        """The camera of that name; raises `DescriptionError` with the nearest one."""
        return self._named(name, "camera", self.cameras)

    def thing(self, name: str) -> Thing:
        """The thing of that name; raises `DescriptionError` with the nearest one."""
        return self._named(name, "thing", self.things)

    def place(self, name: str) -> Place:
        """The place of that name; raises `DescriptionError` with the nearest one."""
        return self._named(name, "place", self.places)

    @property
    def camera_names(self) -> tuple[str, ...]:
        return tuple(camera.name for camera in self.cameras)

    @property
    def all_tags(self) -> tuple[Tagged, ...]:
        """Every record that has a tag."""
        things = [each for each in self.things if isinstance(each, TagThing)]
        return (*self.tags, *things, *(each for each in self.places if isinstance(each, TagPlace)))

    def path_of(self, relative: str) -> Path:
        """A file that cell.toml names."""
        return self.path.parent / Path(relative).expanduser()

    def _named(self, name: str, what: str, among: Sequence[N]) -> N:
        for each in among:
            if each.name == name:
                return each
        names = [each.name for each in among]
        raise wrong_file(self.path, because("cell.none", nearest(name, names), kind=what, name=name))


def deployed_cell(deployment: Deployment) -> Cell:
    """The cell of a deployment, an empty one where it names none; raises `DescriptionError`."""
    if not deployment.cell:
        return Cell(Path())
    return load_cell(Path(deployment.cell), load_arm(Path(deployment.robot)))


def load_cell(path: Path, arm: ArmDescription) -> Cell:
    """The cell around `arm`; raises `DescriptionError` for what is wrong in cell.toml or in camera.toml beside it."""
    return cell_of(read_cell_texts(path), arm)


def read_cell_texts(path: Path) -> CellTexts:
    """cell.toml at `path` and camera.toml beside it, as they travel over the bus; raises `DescriptionError`."""
    measured = path.with_name(CAMERA_FILE)
    return CellTexts(path=str(path), cell=read_text(path), cameras=read_text(measured) if measured.exists() else "")


def cell_of(texts: CellTexts, arm: ArmDescription, *, is_here: bool = True) -> Cell:
    """The cell in these texts; raises `DescriptionError`. The files that it names are looked for where it `is_here`."""
    path, text = Path(texts.path), texts.cell
    data = read_robot_data(path, text, CellFile)
    try:
        file = msgspec.convert(data, CellFile)
    except msgspec.ValidationError as error:
        line, what = type_mistake(error, text)
        if known := _choices(str(error)):
            what = because("cell.kind", what, remedy("known_are", names=known))
        raise wrong_file(path, what, line) from error
    cell = Cell(path, file.camera, file.tag, file.thing, file.place, file.table)
    for keys, fault in _faults(cell, arm, is_here):
        raise wrong_file(path, fault, line_of(keys, text) or 1)
    names = [each.name for each in cell.cameras]
    measured = measured_of(path.with_name(CAMERA_FILE), texts.cameras, names) if texts.cameras else {}
    return Cell(path, file.camera, file.tag, file.thing, file.place, file.table, measured)


def _faults(cell: Cell, arm: ArmDescription, is_here: bool) -> Iterator[Fault]:
    """Where each fault stands, and what is wrong."""
    for what, named in (("camera", cell.cameras), ("thing", cell.things), ("place", cell.places)):
        yield from _repeated(what, [each.name for each in named])
    for number, camera in enumerate(cell.cameras):
        yield from _camera_faults(("camera", number), camera, cell, arm)
    for number, tag in enumerate(cell.tags):
        yield from _parent_faults(("tag", number), Subject("tag", str(tag.id)), tag.parent, arm)
    for number, thing in enumerate(cell.things):
        yield from _thing_faults(("thing", number), thing, arm)
        if is_here:
            yield from _model_faults(("thing", number), thing, cell)
    yield from _tag_faults(cell)


def _repeated(what: str, names: list[str]) -> Iterator[Fault]:
    for number, name in enumerate(names):
        if name in names[:number]:
            yield (what, number, "name"), because("cell.name.twice", kind=what, name=name)


def _camera_faults(keys: Where, camera: CameraRecord, cell: Cell, arm: ArmDescription) -> Iterator[Fault]:
    yield from _parent_faults(keys, Subject("camera", camera.name), camera.parent, arm)
    length = sum((a - b) ** 2 for a, b in zip(camera.position, camera.look_at, strict=True)) ** 0.5
    if length < NEAREST_LOOK:
        yield (*keys, "look_at"), because("cell.camera.look_at", camera=camera.name)
    yield from _source_faults((*keys, "source"), camera.name, camera.source, cell)


def _source_faults(keys: Where, name: str, source: Source, cell: Cell) -> Iterator[Fault]:
    if isinstance(source, FolderSource | FileSource) and not source.path:
        yield (*keys, "path"), because("cell.camera.path", camera=name)
    distortion = getattr(source, "distortion", ())
    if len(distortion) not in (0, 5):
        yield (*keys, "distortion"), because("cell.camera.distortion", camera=name, count=len(distortion))


def _parent_faults(keys: Where, of: Subject, parent: str, arm: ArmDescription) -> Iterator[Fault]:
    if parent and parent not in arm.model.link_names:
        known = nearest(parent, arm.model.link_names)
        yield (*keys, "parent"), of.around(because("cell.parent", known, robot=arm.name, link=parent))


def _thing_faults(keys: Where, thing: Thing, arm: ArmDescription) -> Iterator[Fault]:
    if arm.gripper is not None:
        width, most = grasp_width(thing), arm.gripper.open
        if width >= most:
            key = "grasp_width" if thing.grasp_width is not None else "box"
            yield (*keys, key), because("cell.thing.wide", thing=thing.name, width=width, limit=most)


def _model_faults(keys: Where, thing: Thing, cell: Cell) -> Iterator[Fault]:
    if isinstance(thing, OnnxThing) and not cell.path_of(thing.model).is_file():
        yield (*keys, "model"), because("cell.thing.model", thing=thing.name, file=str(cell.path_of(thing.model)))


def _tag_faults(cell: Cell) -> Iterator[Fault]:
    known: dict[tuple[TagFamily, int], str] = {}
    records: list[tuple[Where, str, object]] = [
        *((("tag", number), f"[[tag]] {number + 1}", tag) for number, tag in enumerate(cell.tags)),
        *((("thing", number), f'[[thing]] "{each.name}"', each) for number, each in enumerate(cell.things)),
        *((("place", number), f'[[place]] "{each.name}"', each) for number, each in enumerate(cell.places)),
    ]
    for keys, owner, record in records:
        if not isinstance(record, TagRecord | TagThing | TagPlace):
            continue
        most, other = TAG_COUNTS[record.family] - 1, known.get((record.family, record.id))
        if record.id > most:
            family = str(record.family)
            what = because("cell.tag.range", owner=owner, family=family, tag=record.id, limit=most)
            yield (*keys, "id"), what
        elif other:
            family = str(record.family)
            what = because("cell.tag.twice", owner=owner, family=family, tag=record.id, other=other)
            yield (*keys, "id"), what
        known[(record.family, record.id)] = owner


def grasp_width(thing: Thing) -> float:
    """[m] between the jaws that hold it: as cell.toml says, else the narrower of its sides, else its tag."""
    if thing.grasp_width is not None:
        return thing.grasp_width
    if thing.box is not None:
        return min(thing.box[0], thing.box[1])
    assert isinstance(thing, TagThing)  # the only one whose box may be absent
    return thing.size


def height_of_frame(thing: Thing) -> float:
    """[m] of the thing's frame above the table that it stands on."""
    if isinstance(thing, TagThing):
        return thing.box[2] if thing.box is not None else 0.0
    return thing.box[2] / 2.0


def _choices(error: str) -> tuple[str, ...]:
    """The kinds that a table can have, where its `kind` is none of them."""
    if not error.endswith(".kind`") and "field `kind`" not in error:
        return ()
    return next((tuple(KINDS[what]) for what in KINDS if f".{what}" in error), ())
