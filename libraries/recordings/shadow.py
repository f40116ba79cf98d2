"""The folder of a robot that is played back: its files as they were recorded, under the name of the shadow."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from gemelo.libraries.recordings.mcap_file import ROBOT
from gemelo.libraries.recordings.reader import BadRecording, RecordingReader
from gemelo.schemas.reasons import because

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
_NAME_LINE = re.compile(r'^name\s*=\s*("[^"]*"|\'[^\']*\')', re.MULTILINE)


def shadow_folder(out: Path, name: str) -> Path:
    """Where the files of the shadow `name` are."""
    return out / "shadows" / name


def recorded_robot(reader: RecordingReader) -> str:
    """The name of the robot that was recorded; empty where the recording does not say."""
    metadata = reader.read_metadata()
    return metadata.get(ROBOT, {}).get("robot") or metadata.get("gemelo", {}).get("robot", "")


def write_shadow(reader: RecordingReader, folder: Path, name: str, original: Path) -> None:
    """Writes URDF, SRDF and robot.toml of the recording, with links to the folders of meshes in `original`.

    Raises `BadRecording` where the recording has no robot's files, or names them in other folders.
    """
    files = reader.metadata.get(ROBOT, {})
    text = files.get("robot_toml", "")
    try:
        robot = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BadRecording(because("recording.robot.unreadable", file=str(reader.path), error=str(error))) from error
    if not text or not _NAME_LINE.search(text):
        raise BadRecording(because("recording.robot.none", file=str(reader.path)))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.toml").write_text(_NAME_LINE.sub(f'name = "{name}"', text, count=1), encoding="utf-8")
    for key in ("urdf", "srdf"):
        file = str(robot.get(key, f"robot.{key}"))
        if Path(file).name != file:
            raise BadRecording(because("recording.robot.elsewhere", file=str(reader.path), name=file))
        (folder / file).write_text(files.get(key, ""), encoding="utf-8")
    _link_folders(original, folder)


def _link_folders(original: Path, folder: Path) -> None:
    """Meshes are not recorded: those of today's robot are used, where it is still there."""
    for each in original.iterdir() if original.is_dir() else ():
        link = folder / each.name
        if each.is_dir() and not link.exists():
            link.symlink_to(each.resolve(), target_is_directory=True)
