"""A recording as a file of Rerun: the arm's links where the frames put them, every number as a curve, and the log."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from gemelo.libraries.recordings.foxglove_shapes import Drawn, drawn_links
from gemelo.libraries.recordings.reader import RecordingReader
from gemelo.libraries.recordings.series import STAMPS, Series
from gemelo.schemas.frames import FrameTransforms, RobotDescription

TIMELINE = "time"  # as in the live view
ARM = "arm"
Pose = tuple[int, tuple[float, ...], tuple[float, ...]]  # [ns] UNIX, translation [m], quaternion


def write_rerun(reader: RecordingReader, series: dict[str, Series], file: Path) -> None:
    """Writes `file`, which may be there; the arm is in it whichever topics were chosen."""
    import rerun as rr  # slow to load, and only here

    stream = rr.RecordingStream("gemelo", recording_id=file.stem)
    stream.save(file)
    try:
        _write_arm(rr, stream, reader)
        for each in series.values():
            _write_curves(rr, stream, each)
            if each.message == "LogRecord":
                _write_log(rr, stream, each)
    finally:
        stream.flush()
        stream.disconnect()


def _write_arm(rr: Any, stream: Any, reader: RecordingReader) -> None:
    parents, poses, links = _frames_in(reader)
    for child, stamped in poses.items():
        times, translations, rotations = zip(*stamped, strict=True)
        stream.send_columns(
            entity_of(child, parents),
            indexes=[_times(rr, times)],
            columns=rr.Transform3D.columns(translation=np.array(translations), quaternion=np.array(rotations)),
        )
    for link in links:
        stream.log(f"{entity_of(link.frame, parents)}/shape", *_shapes(rr, link), static=True)


def _frames_in(reader: RecordingReader) -> tuple[dict[str, str], dict[str, list[Pose]], list[Drawn]]:
    """The parent of each frame, its poses, and the links that have a shape."""
    parents: dict[str, str] = {}
    poses: defaultdict[str, list[Pose]] = defaultdict(list)
    links: list[Drawn] = []
    for row in reader.rows(lambda topic: topic in ("frames", "static_frames", "description")):
        if row.channel.topic == "description":
            links = drawn_links(msgspec.json.decode(row.message.data, type=RobotDescription).urdf)[1]
            continue
        for each in msgspec.json.decode(row.message.data, type=FrameTransforms).transforms:
            parents[each.child] = each.parent
            pose = each.transform
            poses[each.child].append((each.stamp or row.message.log_time, pose.translation, pose.rotation))
    return parents, poses, links


def entity_of(frame: str, parents: dict[str, str]) -> str:
    """A frame's entity: below its parent's, so that it moves with it."""
    names = [frame]
    while names[0] in parents and parents[names[0]] not in names:
        names.insert(0, parents[names[0]])
    return "/".join([ARM, *names])


def _shapes(rr: Any, link: Drawn) -> Iterator[Any]:
    if link.cubes:
        sizes = [(each.size.x, each.size.y, each.size.z) for each in link.cubes]
        yield rr.Boxes3D(sizes=sizes, fill_mode="solid", **_placed(link.cubes))
    if link.spheres:
        radii = [each.size.x / 2 for each in link.spheres]
        yield rr.Ellipsoids3D(radii=radii, fill_mode="solid", **_placed(link.spheres))
    if link.cylinders:
        lengths, wide = [each.size.z for each in link.cylinders], [each.size.x / 2 for each in link.cylinders]
        yield rr.Cylinders3D(lengths=lengths, radii=wide, fill_mode="solid", **_placed(link.cylinders))


def _placed(shapes: tuple[Any, ...]) -> dict[str, Any]:
    """Centres and turns as Rerun's shapes take them."""
    places = [each.pose.position for each in shapes]
    turns = [each.pose.orientation for each in shapes]
    return {
        "centers": [(each.x, each.y, each.z) for each in places],
        "quaternions": [(each.x, each.y, each.z, each.w) for each in turns],
    }


def _write_curves(rr: Any, stream: Any, series: Series) -> None:
    """A curve for each column of numbers."""
    for name in series.columns:
        if name in STAMPS or name.endswith("stamp"):
            continue
        points = [(row["log_time"], row[name]) for row in series.rows if isinstance(row.get(name), int | float)]
        if points:
            times, values = zip(*points, strict=True)
            stream.send_columns(
                f"{series.topic.lstrip('@')}/{name}",
                indexes=[_times(rr, times)],
                columns=rr.Scalars.columns(scalars=np.array(values, dtype=np.float64)),
            )


def _write_log(rr: Any, stream: Any, series: Series) -> None:
    levels = {10: "DEBUG", 20: "INFO", 30: "WARN", 40: "ERROR", 50: "CRITICAL"}
    stream.send_columns(
        "log",
        indexes=[_times(rr, [row["log_time"] for row in series.rows])],
        columns=rr.TextLog.columns(
            text=[f"{row.get('node', '')}: {row.get('text', '')}" for row in series.rows],
            level=[levels.get(int(row.get("level") or 0), "INFO") for row in series.rows],
        ),
    )


def _times(rr: Any, stamps: Any) -> Any:
    """Of [ns] UNIX."""
    return rr.TimeColumn(TIMELINE, timestamp=np.array(stamps, dtype="datetime64[ns]"))
