"""Detection in one image of a camera: tags, coloured things and boxes of the cell, each with its pose. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np

from gemelo.libraries.arm.cell.cell_file import Cell, Tagged, height_of_frame
from gemelo.libraries.arm.cell.colours import RGB, nearest_colour
from gemelo.libraries.arm.frames.transforms import from_rpy
from gemelo.libraries.vision.boxes import (
    BoxFit,
    ColourImage,
    colour_strength,
    coloured_regions,
    coloured_windows,
    fit_box,
)
from gemelo.libraries.vision.camera_model import model_of
from gemelo.libraries.vision.rigid import Array, from_transform, inverse, to_transform
from gemelo.libraries.vision.tag_pose import plane_pose, tag_pose
from gemelo.libraries.vision.tags import Tag, find_tags
from gemelo.libraries.vision.windows import Mask, Window, regions_of, windows_around
from gemelo.schemas.camera import CameraInfo
from gemelo.schemas.cell import BoxThing, Colour, ColourThing, OnnxThing, TagRecord, TagThing
from gemelo.schemas.detections import Detection, DetectionKind, Detections, Unclear
from gemelo.schemas.frames import Transform
from gemelo.schemas.reasons import Reason, Value, because
from gemelo.services.detector.images import NoPicture
from gemelo.services.detector.regions import (
    DetectorView,
    distances_from,
    in_base,
    is_box,
    is_known,
    median_colour,
    rows_of,
    unclear_region,
)
from gemelo.services.detector.user_models import BadModel, Found, PlacedThing, UserModel, standing

# Tuning constants: chosen, where a line does not say measured.
FLAT = 0.003  # [m] a tag so near to the height at which it would lie is taken to lie there
LEVEL = np.radians(8.0)  # and so little tilted
MOVED = 0.003  # [m] a fixed tag that is seen so far away from its place says that the camera was moved
STANDS_OUT = 28.0  # grey levels from the table's colour
LEAST_AREA = 100  # [px] of what stands out
LARGEST_SHARE = 0.08  # of the image that a box may take: what is larger is the arm


class Detector:
    """Finds the things of one cell."""

    def __init__(self, cell: Cell, models: Mapping[Path, UserModel] | None = None) -> None:
        """`models` by their files; things of others are not looked for."""
        self._cell = cell
        self._models = models or {}
        self._modelled = _by_model(cell, self._models)
        self._tagged = {(each.family, each.id): each for each in cell.all_tags}
        self._coloured: dict[Colour, list[ColourThing]] = {}
        for thing in cell.things:
            if isinstance(thing, ColourThing):
                self._coloured.setdefault(thing.colour, []).append(thing)
        self._boxes = [thing for thing in cell.things if isinstance(thing, BoxThing)]

    def look(self, image: ColourImage, info: CameraInfo, base_from_camera: Array | None, stamp: int) -> Detections:
        """Everything in `image` (h, w, 3; red first), taken at `stamp` [ns UNIX] from there.

        ValueError where `info` is no camera's, `NoPicture` where it is of another size than the image.
        """
        model, image = model_of(info), np.ascontiguousarray(image)
        if image.shape[:2] != (info.height, info.width):
            about: dict[str, Value] = {"wanted_width": info.width, "wanted_height": info.height}
            height, width = image.shape[:2]
            raise NoPicture(because("detect.image.size", camera=info.name, width=width, height=height, **about))
        known = self._cell.measured.get(info.name)
        error = known.mount.held_out if known is not None and known.mount is not None else 0.0
        view = DetectorView(image, model, base_from_camera, error)
        tags = list(self._tags(view))
        items = [item for _, item in tags]
        unclear: list[Unclear] = []
        if base_from_camera is not None and self._cell.table is not None:
            for found in self._colours(view):
                if isinstance(found, Unclear):
                    unclear.append(found)
                else:
                    items.append(found)
            items += self._classes(view)
            items += self._standing_out(view, items)
        doubt = self._doubt(tags)
        return Detections(
            stamp=stamp,
            camera=info.name,
            items=tuple(items),
            unclear=tuple(unclear),
            doubt=str(doubt or ""),
            doubt_why=doubt,
        )

    def _tags(self, view: DetectorView) -> Iterator[tuple[Tagged, Detection]]:
        grey = np.asarray(cv2.cvtColor(view.image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        for family in sorted({family for family, _ in self._tagged}):
            for tag in find_tags(grey, view.model, family):
                record = self._tagged.get((family, tag.id))
                if record is not None:
                    yield record, self._tag_item(view, tag, record)

    def _tag_item(self, view: DetectorView, tag: Tag, record: Tagged) -> Detection:
        """By the plane that it lies on where it lies on one, else in space; the table's normal tells the two apart."""
        normal = self._normal(view, record)
        solved = tag_pose(tag, view.model, record.size, normal)
        pose, sigma = solved.camera_from_tag, solved.sigma
        plane = self._plane_of(view, record)
        if plane is not None and _lies_on(plane, pose, sigma):
            pose, covariance = plane_pose(tag, view.model, record.size, plane)
            sigma = float(np.sqrt(covariance[0, 0] + covariance[1, 1]))
        return Detection(
            name=_name_of(record),
            kind=DetectionKind.TAG,
            corners=rows_of(tag.corners),
            camera_from_thing=to_transform(pose),
            base_from_thing=in_base(view, pose),
            is_located=view.base_from_camera is not None,
            sigma=float(np.hypot(sigma, view.mount_error)),
            flip_ratio=0.0 if normal is not None else solved.flip_ratio,
        )

    def _normal(self, view: DetectorView, record: Tagged) -> Array | None:
        """The direction (3,) of the camera frame to which the tag's z is nearest; None where nothing is known of it."""
        if view.base_from_camera is None or (isinstance(record, TagRecord) and record.parent):
            return None
        turn = from_transform(Transform(rotation=from_rpy(*record.rpy))) if isinstance(record, TagRecord) else np.eye(4)
        return np.asarray(inverse(view.base_from_camera)[:3, :3] @ turn[:3, 2])

    def _plane_of(self, view: DetectorView, record: Tagged) -> Array | None:
        """camera_from_plane of where it would lie; None for a tag that need not lie."""
        table = self._cell.table
        if isinstance(record, TagRecord):
            is_flat = not record.parent and record.rpy[:2] == (0.0, 0.0)
            return view.plane(record.position[2]) if is_flat else None
        if table is None:
            return None
        return view.plane(table + (height_of_frame(record) if isinstance(record, TagThing) else 0.0))

    def _doubt(self, tags: Sequence[tuple[Tagged, Detection]]) -> Reason | None:
        """Why the camera is not believed to stand where it stood: the fixed tag that is farthest from its place."""
        off = {}
        for record, item in tags:
            if isinstance(record, TagRecord) and not record.parent and item.is_located:
                apart = np.subtract(item.base_from_thing.translation, record.position)
                off[record.id] = float(np.linalg.norm(apart)) - 3.0 * item.sigma
        if not off or max(off.values()) < MOVED:
            return None
        worst = max(off, key=lambda number: off[number])
        return because("detect.tag_moved", tag=worst, distance=1e3 * off[worst])

    def _colours(self, view: DetectorView) -> Iterator[Detection | Unclear]:
        for colour, things in self._coloured.items():
            for window, core in coloured_windows(view.half, view.image.shape[:2], RGB[colour]):
                part = view.within(window)
                strength = colour_strength(part.image, RGB[colour])
                for region in coloured_regions(strength):
                    if region[core].any() and nearest_colour(np.median(part.image[region], axis=0)) is colour:
                        best = self._best_box(part, strength, region, things)
                        if best is not None:
                            yield self._box_item(part, *best, DetectionKind.COLOUR, window)
                        else:
                            yield unclear_region(things, region, window)

    def _classes(self, view: DetectorView) -> Iterator[Detection]:
        """What the models of users find, as boxes of the things' size on the table."""
        assert self._cell.table is not None
        plane = view.plane(self._cell.table)
        assert plane is not None
        for path, things in self._modelled.items():
            found = self._models[path].look(view.image, min(thing.threshold for _, thing in things))
            for label, thing in things:
                for each in found:
                    if each.label == label and each.score >= thing.threshold:
                        place = standing(each, view.model, plane, thing.box)
                        if place is not None:
                            yield _class_item(view, thing, each, plane, place)

    def _standing_out(self, view: DetectorView, found: Sequence[Detection]) -> Iterator[Detection]:
        """Boxes by nothing but that they have another colour than the table."""
        if not self._boxes:
            return
        table, height, width = median_colour(view.half), *view.image.shape[:2]
        mask = distances_from(view.half, table) > STANDS_OUT
        largest = LARGEST_SHARE * mask.size
        for window, core in windows_around(mask, (height, width), LEAST_AREA // 8, largest):
            part = view.within(window)
            away = np.clip(distances_from(part.image, table), 0.0, 255.0).astype(np.uint8)
            for region in regions_of(cv2.medianBlur(away, 3) > STANDS_OUT, LEAST_AREA):
                if not region[core].any() or region.sum() > LARGEST_SHARE * height * width:
                    continue
                if is_known(region, window, found):
                    continue
                direction = np.median(part.image[region], axis=0) - table
                strength = np.asarray((part.image - table) @ direction / (direction @ direction))
                best = self._best_box(part, strength, region, self._boxes)
                if best is not None:
                    yield self._box_item(part, *best, DetectionKind.BOX, window)

    def _best_box(
        self, view: DetectorView, strength: Array, region: Mask, things: Sequence[ColourThing | BoxThing]
    ) -> tuple[ColourThing | BoxThing, BoxFit] | None:
        """The thing whose outline is the region's, and where it stands; None where it is that of none of them."""
        assert self._cell.table is not None
        plane = view.plane(self._cell.table)
        assert plane is not None
        fits = [(thing, fit_box(strength, region, view.model, plane, thing.box)) for thing in things]
        good = [(thing, fit) for thing, fit in fits if fit is not None and is_box(fit, region)]
        return min(good, key=lambda each: each[1].error) if good else None

    def _box_item(
        self, view: DetectorView, thing: ColourThing | BoxThing, fit: BoxFit, kind: DetectionKind, window: Window
    ) -> Detection:
        """`view` is what the `window` shows."""
        assert self._cell.table is not None
        plane = view.plane(self._cell.table)
        assert plane is not None
        pose = plane @ fit.plane_from_box
        return Detection(
            name=thing.name,
            kind=kind,
            corners=rows_of(fit.outline + np.array([window.left, window.top])),
            camera_from_thing=to_transform(pose),
            base_from_thing=in_base(view, pose),
            is_located=True,
            sigma=float(np.hypot(fit.sigma, view.mount_error)),
        )


def _by_model(cell: Cell, models: Mapping[Path, UserModel]) -> dict[Path, list[tuple[int, OnnxThing]]]:
    """The things of each model's file with the number of their class; not those of a class that it does not have."""
    found: dict[Path, list[tuple[int, OnnxThing]]] = {}
    for thing in cell.things:
        if isinstance(thing, OnnxThing) and cell.path_of(thing.model) in models:
            with suppress(BadModel):
                label = models[cell.path_of(thing.model)].number_of(thing.label)
                found.setdefault(cell.path_of(thing.model), []).append((label, thing))
    return found


def _class_item(view: DetectorView, thing: OnnxThing, found: Found, plane: Array, place: PlacedThing) -> Detection:
    left, upper, right, lower = found.sides
    pose = plane @ place.plane_from_box
    return Detection(
        name=thing.name,
        kind=DetectionKind.ONNX,
        corners=rows_of(np.array([[left, upper], [right, upper], [right, lower], [left, lower]])),
        camera_from_thing=to_transform(pose),
        base_from_thing=in_base(view, pose),
        is_located=True,
        sigma=float(np.hypot(place.sigma, view.mount_error)),
    )


def _name_of(record: Tagged) -> str:
    return f"tag {record.id}" if isinstance(record, TagRecord) else record.name


def _lies_on(plane: Array, pose: Array, sigma: float) -> bool:
    """True if the tag at `pose` may lie on the plane: as far as can be told in space."""
    local = inverse(plane) @ pose
    tilt = float(np.arccos(np.clip(local[2, 2], -1.0, 1.0)))
    return abs(float(local[2, 3])) < FLAT + 3.0 * sigma and tilt < LEVEL
