"""Taught points: joint values under a name, in one file for each robot, each with a picture if there is one."""

from __future__ import annotations

import hashlib
import math
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from gemelo.api.errors import BadArgument
from gemelo.api.targets import Joints, named_joints
from gemelo.api.whole_files import write_whole
from gemelo.libraries.arm.errors import nearest
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.toml_lines import nearest_line, toml_lines
from gemelo.programs.mistakes import Mistake, ProgramError
from gemelo.programs.names import checked_folder, point_name, read_text
from gemelo.programs.program import VERSION
from gemelo.programs.reading import load_toml
from gemelo.programs.toml_text import key_text, value_text
from gemelo.schemas.reasons import Reason, because

LARGEST_PICTURE = 10_000_000  # [bytes]
KINDS = {b"\x89PNG\r\n\x1a\n": "png", b"\xff\xd8\xff": "jpg"}  # of pictures, by how they begin


@dataclass(frozen=True)
class Point:
    """A taught point: `joints` [rad] or [m] by joint, and its `picture` beside the file of points."""

    joints: dict[str, float]
    picture: Path | None = None


class Points(Mapping[str, Point]):
    """The taught points of one robot, by name; every change is on the disk when its method returns.

    Each method may be called from any thread. What another process has written meanwhile stays.

    >>> from gemelo.programs import Points
    >>> points = Points.load(folder, arm.description)
    >>> points.remember("above the box", arm.joints)
    >>> list(points), points["above the box"].joints == arm.joints
    (['above the box'], True)
    """

    def __init__(self, folder: Path, robot: ArmDescription) -> None:
        self.file = folder / f"{robot.name}.points.toml"
        self._robot = robot
        self._lock = threading.RLock()
        self._points: dict[str, Point] = {}

    @classmethod
    def load(cls, folder: str | Path, robot: ArmDescription) -> Points:
        """Those of `<folder>/<robot>.points.toml`, none if there is no file; raises `ProgramError`.

        >>> from gemelo.programs import Points
        >>> len(Points.load(folder, arm.description))
        0
        """
        points = cls(checked_folder(folder), robot)
        points.reload()
        return points

    def reload(self) -> None:
        """Reads the file again; raises `ProgramError` with all of its mistakes."""
        with self._lock:
            self._points = _read(self.file, self._robot) if self.file.exists() else {}

    def remember(self, name: str, joints: Joints, picture: bytes | None = None, *, overwrite: bool = False) -> None:
        """Keeps joint values [rad] or [m] of all joints under `name`, and a PNG or JPEG picture.

        Raises `BadArgument`, also where there is one of that name, unless it is told to `overwrite`.
        """
        values = _whole(self._robot, point_name(name), joints)
        kept = self._keep_picture(picture) if picture is not None else None
        with self._lock:
            self.reload()
            if name in self._points and not overwrite:
                raise BadArgument(because("point.exists.overwrite", point=name))
            self._save({**self._points, name: Point(values, kept)})

    def rename(self, old: str, new: str) -> None:
        """Gives a point another name; its place in the list and its picture stay. Raises `BadArgument`."""
        point_name(new)
        with self._lock:
            self.reload()
            self.require(old)
            if new in self._points and new != old:
                raise BadArgument(because("point.exists", point=new))
            self._save({new if name == old else name: point for name, point in self._points.items()})

    def remove(self, name: str) -> None:
        """Forgets a point, and removes its picture. Raises `BadArgument`."""
        with self._lock:
            self.reload()
            self.require(name)
            self._save({each: point for each, point in self._points.items() if each != name})

    def require(self, name: str) -> Point:
        """The point; raises `BadArgument` with the nearest name."""
        if name not in self._points:
            raise BadArgument(because("point.unknown", nearest(name, self._points), point=name, robot=self._robot.name))
        return self._points[name]

    def __getitem__(self, name: str) -> Point:
        return self._points[name]

    def __iter__(self) -> Iterator[str]:
        return iter(tuple(self._points))

    def __len__(self) -> int:
        return len(self._points)

    def _keep_picture(self, content: bytes) -> Path:
        """Under a name made of its content."""
        kind = next((kind for begin, kind in KINDS.items() if content.startswith(begin)), "")
        if not kind:
            raise BadArgument(because("point.picture.format", size=len(content)))
        if len(content) > LARGEST_PICTURE:
            raise BadArgument(because("point.picture.size", size=len(content), limit=LARGEST_PICTURE))
        path = self._pictures / f"{hashlib.sha256(content).hexdigest()[:16]}.{kind}"
        write_whole(path, content)
        return path

    @property
    def _pictures(self) -> Path:
        return self.file.with_name(self.file.name.removesuffix(".toml"))

    def _save(self, points: dict[str, Point]) -> None:
        """Writes the file, then removes the pictures that no point has any more."""
        gone = {each.picture for each in self._points.values()} - {each.picture for each in points.values()}
        write_whole(self.file, _text(self._robot.name, points).encode())
        self._points = points
        for picture in gone:
            if picture is not None:
                picture.unlink(missing_ok=True)


def _whole(robot: ArmDescription, name: str, joints: Joints) -> dict[str, float]:
    """Values of all joints, in their order, each within its limits; raises `BadArgument`."""
    values = named_joints(robot, joints, f'point "{name}"')
    missing = tuple(joint for joint in robot.joint_names if joint not in values)
    if missing:
        raise BadArgument(because("point.joint.missing", point=name, joints=missing))
    for joint in robot.joints:
        if not joint.is_within(joint.rounded(values[joint.name])):
            why = because(
                "point.joint.limits", point=name, joint=joint.name, value=values[joint.name],
                lower=joint.lower, upper=joint.upper, unit=joint.unit,
            )  # fmt: skip
            raise BadArgument(why)
    return {joint: values[joint] for joint in robot.joint_names}


def _text(robot: str, points: Mapping[str, Point]) -> str:
    parts = [f"version = {VERSION}", f"robot = {value_text(robot)}"]
    for name, point in points.items():
        parts += ["", f"[points.{key_text(name)}]", f"joints = {value_text(point.joints)}"]
        if point.picture is not None:
            parts.append(f"picture = {value_text(f'{point.picture.parent.name}/{point.picture.name}')}")
    return "\n".join([*parts, ""])


def _read(file: Path, robot: ArmDescription) -> dict[str, Point]:
    text = read_text(file)
    data = load_toml(text, str(file))
    lines = toml_lines(text)
    mistakes: list[Mistake] = []

    def add(what: Reason, *place: str) -> None:
        line = nearest_line(lines, place)
        mistakes.append(Mistake(str(file), line, (), what))

    if "version" not in data:
        add(because("file.version.none", known=VERSION), "version")
    elif data["version"] != VERSION:
        add(because("file.version.other", value=repr(data["version"]), known=VERSION), "version")
    if data.get("robot", robot.name) != robot.name:
        add(because("point.robot.other", robot=str(data["robot"]), present=robot.name), "robot")
    for key in data.keys() - {"version", "robot", "points"}:
        add(because("file.key.unknown", nearest(key, ("version", "robot", "points")), key=key), key)
    given = data.get("points", {})
    if not isinstance(given, dict):
        add(because("point.table", value=repr(given)), "points")
        given = {}
    found: dict[str, Point] = {}
    for name, point in given.items():
        try:
            found[name] = _point(name, point, robot, file, add)
        except BadArgument as error:
            add(error.reason, "points", name, "joints")
    if mistakes:
        raise ProgramError(sorted(mistakes, key=lambda each: each.line))
    return found


def _point(name: str, given: object, robot: ArmDescription, file: Path, add: Callable[..., None]) -> Point:
    point_name(name)
    if not isinstance(given, dict) or not isinstance(given.get("joints"), dict):
        raise BadArgument(because("point.joint.none", point=name, example=f"{{{robot.joint_names[0]} = 0.5}}"))
    for key in given.keys() - {"joints", "picture"}:
        add(because("point.key", nearest(key, ("joints", "picture")), point=name, key=key), "points", name, key)
    for joint, value in given["joints"].items():
        if isinstance(value, bool | str) or not math.isfinite(value):
            raise BadArgument(because("point.joint.number", point=name, joint=joint, value=repr(value)))
    point = Point(_whole(robot, name, given["joints"]))
    picture = given.get("picture")
    if picture is None:
        return point
    if not isinstance(picture, str) or "\0" in picture or ".." in Path(picture).parts or Path(picture).is_absolute():
        add(because("point.picture.place", point=name, value=repr(picture)), "points", name, "picture")
        return point
    return replace(point, picture=file.parent / picture)
