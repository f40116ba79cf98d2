"""Updates into one Rerun recording stream; with the layout, the only place that knows Rerun's columns."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from gemelo.schemas.reasons import say
from gemelo.schemas.reasons.catalogue import ENGLISH
from gemelo.services.visualizer.content import entities, palette
from gemelo.services.visualizer.content.updates import (
    ClearEntity,
    Frustum,
    Labels,
    LineStrip,
    LogLines,
    Outlines,
    PictureUpdate,
    Poses,
    Scalars,
    SolidMesh,
    StateUpdate,
    TextPanel,
    Times,
    Tint,
    TranslucentArm,
    Update,
)
from gemelo.services.visualizer.content.view_words import COMMANDED, ERROR, EXECUTED, LOST, band_labels, mode_labels
from gemelo.services.visualizer.model.mesh_files import mesh_path
from gemelo.services.visualizer.model.triangle_meshes import ShadedMesh, primitive_mesh
from gemelo.services.visualizer.model.visual_model import Visual, VisualJoint, VisualModel
from gemelo.services.visualizer.render.layout import TIMELINE

APPLICATION = "gemelo"
FRUSTUM_LENGTH = 0.12  # [m] from the camera to the picture that is drawn in the scene
GHOST_MARGIN = 0.0015  # [m] the ghost is a skin around the arm, or the two would flicker


class Sink:
    """A stream that has been told the static things, and takes updates."""

    def __init__(
        self,
        stream: rr.RecordingStream,
        model: VisualModel,
        folder: Path,
        layout: rrb.Blueprint,
        robot: str = "",
        story: str = "",
        language: str = ENGLISH,
    ) -> None:
        """`folder` holds the robot's meshes; `robot` is its name where several arms are in the stream.

        A `story` in Markdown is what is told of a recording.
        """
        self._stream, self._language = stream, language
        self._model = model
        self._folder = folder  # of the robot: meshes stand relative to it
        self._robot = robot
        self._send_static()
        if story:
            self._static(entities.STORY, rr.TextDocument(story, media_type="text/markdown"))
        stream.send_blueprint(layout)

    def write(self, updates: list[Update]) -> None:
        """Send a batch."""
        for update in updates:
            self._write(update)

    def close(self, timeout: float = 2.0) -> None:
        """Hand over what is left, waiting at most `timeout` [s], and let go."""
        try:
            self._stream.flush(timeout_sec=timeout)
        finally:
            self._stream.disconnect()

    def _write(self, update: Update) -> None:
        match update:
            case Scalars(entity, times, values):
                columns = rr.Scalars.columns(scalars=values if values.shape[1] > 1 else values[:, 0])
                self._send(entity, times, columns)
            case Poses(entity, times, translations, rotations):
                columns = rr.Transform3D.columns(translation=translations, quaternion=rotations)
                self._send(entity, times, columns)
            case LineStrip(entity, time, points):
                self._send(entity, _once(time), rr.LineStrips3D.columns(strips=[points]))
            case TextPanel(entity, time, markdown):
                self._send(entity, _once(time), rr.TextDocument.columns(text=[markdown], media_type=["text/markdown"]))
            case StateUpdate(entity, time, state):
                self._send(entity, _once(time), rr.StateChange.columns(state=[state]))
            case Tint(root, time, mode):
                self._tint(root, time, palette.TINTS.get(mode))
            case SolidMesh(entity, time, mesh, translation, rotation, color):
                pose = rr.Transform3D(translation=translation, quaternion=rotation)
                self._log(entity, time, pose, _solid(mesh, color))
            case ClearEntity(entity, time):
                self._log(entity, time, rr.Clear(recursive=True))
            case Labels(entity, time, points, texts):
                dots = rr.Points3D(points, labels=texts, colors=[palette.LABEL], radii=[0.006], show_labels=True)
                self._log(entity, time, dots)
            case PictureUpdate(entity, time, jpeg):
                self._log(entity, time, rr.EncodedImage(contents=jpeg, media_type="image/jpeg"))
            case Frustum():
                self._frustum(update)
            case Outlines(entity, time, strips, texts):
                lines = rr.LineStrips2D(strips, labels=texts, colors=[palette.FOUND], radii=[1.0], show_labels=True)
                self._log(entity, time, lines)
            case TranslucentArm(root, time, touching, color):
                self._translucent_arm(root, time, touching, color)
            case LogLines(entity, times, texts, levels):
                self._send(entity, times, rr.TextLog.columns(text=list(texts), level=[_level(name) for name in levels]))

    def _tint(self, root: str, time: int, tint: palette.Color | None) -> None:
        """Colours an arm, or gives it back its own colours."""
        for entity, visual in self._visuals(root):
            kind = rr.Asset3D if visual.shape.kind == "mesh" else rr.Mesh3D
            color = tint or _own_color(visual)
            columns = kind.columns(albedo_factor=[color] if color else []).partition([1 if color else 0])
            self._send(entity, _once(time), columns)

    def _translucent_arm(self, root: str, time: int, touching: frozenset[str], color: palette.Rgba) -> None:
        """The arm once more, to be taken away again: nothing of it is static but the fixed joints' poses."""
        for joint in self._model.joints:
            if not joint.is_moving:
                pose = rr.Transform3D(translation=joint.translation, quaternion=joint.rotation)
                self._log(f"{root}/{self._model.paths[joint.child]}", time, pose)
        red = {f"{root}/{self._model.paths[link]}/" for link in touching if link in self._model.paths}
        for entity, visual in self._visuals(root):
            is_red = entity.rpartition("/")[0] + "/" in red
            drawn = self._drawn(visual, palette.IN_CONTACT if is_red else color)
            if drawn is not None:
                pose = rr.Transform3D(translation=visual.translation, quaternion=visual.rotation)
                self._log(entity, time, pose, drawn)

    def _frustum(self, update: Frustum) -> None:
        """The camera's pose on the arm or the table, and its lens; the images have a view of their own."""
        lens = rr.Pinhole(
            image_from_camera=np.array(update.intrinsics).reshape(3, 3), resolution=update.size,
            camera_xyz=rr.ViewCoordinates.RDF, image_plane_distance=FRUSTUM_LENGTH, color=palette.FRUSTUM,
        )  # fmt: skip
        pose = rr.Transform3D(translation=update.translation, quaternion=update.rotation)
        self._log(update.entity, update.time, pose)
        self._log(f"{update.entity}/lens", update.time, lens)

    def _log(self, entity: str, time: int, *components: rr.AsComponents) -> None:
        self._stream.set_time(TIMELINE, timestamp=np.datetime64(time, "ns"))
        for component in components:
            self._stream.log(self._at(entity), component)
        self._stream.reset_time()

    def _send(self, entity: str, times: Times, columns: rr.ComponentColumnList) -> None:
        index = rr.TimeColumn(TIMELINE, timestamp=times.astype("datetime64[ns]"))
        self._stream.send_columns(self._at(entity), [index], columns)

    def _static(self, entity: str, *components: rr.AsComponents) -> None:
        """What holds at all times."""
        self._stream.log(self._at(entity), *components, static=True)

    def _at(self, entity: str) -> str:
        return entities.under(self._robot, entity)

    def _send_static(self) -> None:
        self._static(entities.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        for root, is_ghost in ((entities.MEASURED, False), (entities.COMMANDED, True)):
            self._send_arm(root, is_ghost)
        self._static(entities.PATH, rr.LineStrips3D.from_fields(colors=[palette.PATH], radii=[0.0022]))
        self._static(entities.TRAIL, rr.LineStrips3D.from_fields(colors=[palette.TRAIL], radii=[0.0012]))
        for joint in self._model.moving:
            self._send_styles(joint)
        names = list(palette.MODES)
        modes = rr.StateConfiguration(
            values=names, labels=mode_labels(self._language), colors=list(palette.MODES.values())
        )
        self._static(entities.MODE, modes)

    def _send_arm(self, root: str, is_ghost: bool) -> None:
        for joint in self._model.joints:
            pose = rr.Transform3D(translation=joint.translation, quaternion=joint.rotation)
            self._stream.log(self._at(f"{root}/{self._model.paths[joint.child]}"), pose, static=not joint.is_moving)
        for entity, visual in self._visuals(root):
            pose = rr.Transform3D(translation=visual.translation, quaternion=visual.rotation)
            drawn = self._drawn(visual, palette.GHOST if is_ghost else None)
            if drawn is not None:
                self._static(entity, pose, drawn)

    def _visuals(self, root: str) -> Iterator[tuple[str, Visual]]:
        """Every visual with the entity that it has under `root`."""
        for link, visuals in self._model.visuals.items():
            for index, visual in enumerate(visuals):
                yield f"{root}/{self._model.paths[link]}/visual_{index}", visual

    def _drawn(self, visual: Visual, color: palette.Rgba | None) -> rr.Mesh3D | rr.Asset3D | None:
        """The visual, a skin around it where `color` is given; None where its file is missing.

        That is not worth the whole view. The measured arm has its colours from `Tint`: what is static cannot change.
        """
        if visual.shape.kind == "mesh":
            path = mesh_path(self._folder, visual.shape.file)
            return rr.Asset3D(path=path, albedo_factor=color) if path.is_file() else None
        return _solid(primitive_mesh(visual.shape, GHOST_MARGIN if color else 0.0), color)

    def _send_styles(self, joint: VisualJoint) -> None:
        labels = (COMMANDED, EXECUTED, ERROR, LOST)
        commanded, executed, error, lost = (say(label, self._language) for label in labels)
        self._style(entities.commanded(joint.name), [(commanded, palette.COMMANDED, 4.0)])
        self._style(entities.executed(joint.name), [(executed, palette.EXECUTED, 1.5)])
        band = [(name, palette.BAND, 1.5) for name in band_labels(self._language)]
        self._style(entities.error(joint.name), [(error, palette.ERROR, 1.5), *band])
        self._style(entities.shaft(joint.name), [(lost, palette.SHAFT, 1.5)])

    def _style(self, entity: str, series: list[tuple[str, palette.Color, float]]) -> None:
        names, colors, widths = zip(*series, strict=True)
        self._static(entity, rr.SeriesLines(colors=colors, widths=widths, names=names))


def _solid(mesh: ShadedMesh, color: palette.Rgba | None) -> rr.Mesh3D:
    return rr.Mesh3D(
        vertex_positions=mesh.vertices, vertex_normals=mesh.normals, triangle_indices=mesh.triangles,
        albedo_factor=color,
    )  # fmt: skip


def _own_color(visual: Visual) -> palette.Color | None:
    """The URDF's colour; None leaves a mesh file those that it brings itself."""
    return visual.color or (None if visual.shape.kind == "mesh" else palette.ARM)


def _once(time: int) -> Times:
    return np.array([time], dtype=np.int64)


def _level(name: str) -> str:
    return {"WARNING": "WARN", "FATAL": "CRITICAL"}.get(name, name)
