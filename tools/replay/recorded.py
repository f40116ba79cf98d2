"""A recording as the inputs and outputs of one service: whole, of this robot, and of the messages spoken here."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

import msgspec

from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.recordings.channels import schema_of
from gemelo.libraries.recordings.foreign import METADATA
from gemelo.libraries.recordings.mcap_file import DEPLOYMENT, ROBOT
from gemelo.libraries.recordings.reader import RecordingReader, Row
from gemelo.libraries.recordings.table import described
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.message import Message
from gemelo.schemas.scene import SceneMesh
from gemelo.schemas.text_file import read_text
from gemelo.schemas.topics import Topic, scene_mesh

M = TypeVar("M", bound=Message)

FILES = {"urdf": "URDF", "srdf": "SRDF", "robot_toml": "robot.toml"}  # as the recording keeps them
AGAIN = "record again with this version (the recordings of the tests: `make recordings`)"


class NotReplayable(ValueError):
    """A recording that cannot be replayed; one sentence with what is wrong and what would do."""


@dataclass(frozen=True)
class Heard(Generic[M]):
    """One recorded message, which is decoded when it is looked at: an hour of them would be gigabytes."""

    file: Path
    topic: Topic[M]
    data: bytes
    sequence: int  # in its topic, from 0
    stamp: int  # [ns] UNIX, the message's own; of one without, its arrival
    arrival: int  # [ns] UNIX, at the recorder
    began: int  # [ns] UNIX arrival of the first message of the recording
    added: frozenset[str] = frozenset()  # fields that its recorded schema does not have: it is older than they are

    @property
    def at(self) -> float:
        """[s] into the recording."""
        return (self.arrival - self.began) / 1e9

    @property
    def message(self) -> M:
        """Raises `NotReplayable`."""
        try:
            message = msgspec.json.decode(self.data, type=self.topic.message)
        except (msgspec.DecodeError, ValueError) as error:
            raise NotReplayable(f"{self._name} cannot be read: {error}; {AGAIN}") from error
        if left_out := [name for name in missing_fields(self.data, message) if name not in self.added]:
            raise NotReplayable(f"{self._name} has no {left_out[0]}, which its own schema has; {AGAIN}")
        return message

    @property
    def _name(self) -> str:
        return f"{self.file}: message {self.sequence} of {self.topic.key}"


@dataclass
class Recorded:
    """The messages of `topics`, decoded; raises `NotReplayable`, `BadRecording`."""

    path: Path
    topics: Iterable[Topic[Any]]
    robot: Path | None = None  # the folder of the arm; None: that of the recorded arm, in this checkout
    seconds: float = 0.0  # from the first message of the whole recording to the last
    added: dict[str, frozenset[str]] = field(default_factory=dict)  # by topic: fields that it did not have then
    _heard: dict[str, list[Heard[Any]]] = field(default_factory=lambda: defaultdict(list))
    _first: int = 0  # [ns] UNIX arrival of the first message

    def __post_init__(self) -> None:
        self._reader = RecordingReader(self.path)
        self._reader.require_own()
        wanted = {topic.key: topic for topic in self.topics}
        last = 0
        for row in self._reader.rows():
            time = row.message.log_time
            self._first, last = min(self._first or time, time), max(last, time)
            if not row.is_derived and row.channel.topic in wanted:
                self._take(wanted[row.channel.topic], row)
        if self._reader.damage.is_any:
            said = f"{self.path}: {self._reader.damage.problem}"
            raise NotReplayable(f"{said}; `gemelo bag repair {self.path}` writes what is readable, replay that")
        if not self._first:
            raise NotReplayable(f"{self.path}: there is no message in it; record while the twin runs")
        self.seconds = (last - self._first) / 1e9
        for topic in self.topics:
            self._require_unbroken(topic)

    def of(self, topic: Topic[M]) -> list[Heard[M]]:
        """The messages of one of the topics, in their order."""
        return cast("list[Heard[M]]", self._heard[topic.key])

    def meshes(self) -> dict[str, bytes]:
        """The files of the meshes of all recorded scenes, by digest."""
        before = scene_mesh("").key
        rows = self._reader.rows(lambda topic: topic.startswith(before))
        found = (msgspec.json.decode(row.message.data, type=SceneMesh) for row in rows)
        return {mesh.digest: mesh.data for mesh in found}

    def require(self, topic: Topic[M]) -> list[Heard[M]]:
        """As `of`; raises `NotReplayable` where there is none."""
        if not self._heard[topic.key]:
            raise NotReplayable(
                f"{self.path}: there is no message of {topic.key}, which {topic.writer} writes and a replay needs; "
                f"record it too (`gemelo bag record` without topics, or the recording that `logger` writes by itself)"
            )
        return self.of(topic)

    def at(self, unix: int) -> float:
        """[s] into the recording at `unix` [ns]."""
        return float((unix - self._first) / 1e9)

    @property
    def versions(self) -> dict[str, str]:
        """The software that was recorded, and the machine."""
        return self._reader.metadata.get(METADATA, {})

    def arm(self) -> ArmDescription:
        """The arm that was recorded, of this checkout's files; raises `NotReplayable` where they are not the same."""
        recorded = self._reader.metadata.get(ROBOT)
        if recorded is None:
            raise NotReplayable(
                f"{self.path}: the robot's files are not in it, so nobody knows which arm it is; record the topic "
                "`description` too"
            )
        folder = self.robot or self._folder()
        arm = load_arm(folder)
        if arm.name != recorded["robot"]:
            raise NotReplayable(
                f'{self.path}: it is of the robot "{recorded["robot"]}", and {folder} is "{arm.name}": name the '
                "folder of that robot with --robot"
            )
        for name, path in (("urdf", arm.urdf_path), ("srdf", arm.srdf_path), ("robot_toml", arm.robot_path)):
            if recorded[name] != (here := read_text(path)):
                raise NotReplayable(
                    f"{self.path}: its {FILES[name]} is another than {path}, first in line "
                    f"{first_other_line(recorded[name], here)}: {self._with_its_own_version()}"
                )
        return arm

    def _folder(self) -> Path:
        """In this checkout, else where it was recorded."""
        deployment = json.loads(self._reader.metadata.get(DEPLOYMENT, {}).get("json", "{}"))
        said = Path(str(deployment.get("robot", "")))
        for folder in (project_root() / "urdf" / said.name, project_root() / said):
            if (folder / "robot.toml").exists():
                return folder
        raise NotReplayable(
            f'{self.path}: it is of the robot in "{said}", and there is no such folder here: name it with --robot'
        )

    def _with_its_own_version(self) -> str:
        commit = self.versions.get("commit", "")
        return f"replay it with the files of commit {commit[:12]}, or {AGAIN}" if commit else AGAIN

    def _take(self, topic: Topic[Any], row: Row) -> None:
        here = schema_of(described(topic))
        if not is_part_of(row.schema.data, here):
            raise NotReplayable(
                f"{self.path}: its message {row.schema.name} of {topic.key} has other fields than here: "
                f"{_other_fields(row.schema.data, here)}; {self._with_its_own_version()}"
            )
        if added := added_fields(row.schema.data, here):
            self.added[topic.key] = added
        said = row.message
        heard = Heard(self.path, topic, said.data, said.sequence, said.publish_time, said.log_time, self._first, added)
        self._heard[topic.key].append(heard)

    def _require_unbroken(self, topic: Topic[Any]) -> None:
        for before, after in pairwise(self._heard[topic.key]):
            if after.sequence != before.sequence + 1:
                raise NotReplayable(
                    f"{self.path}: {after.sequence - before.sequence - 1} messages of {topic.key} are missing between "
                    f"{before.at:.3f} s and {after.at:.3f} s (sequence {before.sequence} is followed by "
                    f"{after.sequence}): what was heard after that cannot be replayed; take another recording"
                )


def first_other_line(one: str, other: str) -> int:
    """The number of the first line, from 1, in which two texts differ."""
    lines = list(zip(one.splitlines(), other.splitlines(), strict=False))
    return next((number for number, (ours, theirs) in enumerate(lines, 1) if ours != theirs), len(lines) + 1)


@lru_cache(maxsize=256)
def is_part_of(recorded: bytes, here: bytes) -> bool:
    """True if every field of the recorded schema is here with its type; one that was added since has its default."""
    return recorded == here or _is_part_of(json.loads(recorded or b"{}"), json.loads(here or b"{}"))


def _is_part_of(recorded: Any, here: Any) -> bool:
    if isinstance(recorded, dict) and isinstance(here, dict):
        fields = {key: value for key, value in recorded.items() if not (key == "description" and type(value) is str)}
        return all(key in here and _is_part_of(value, here[key]) for key, value in fields.items())
    if isinstance(recorded, list) and isinstance(here, list):
        return len(recorded) == len(here) and all(map(_is_part_of, recorded, here))
    return bool(recorded == here)


@lru_cache(maxsize=256)
def added_fields(recorded: bytes, here: bytes) -> frozenset[str]:
    """The names of the fields that messages have here, at the top or within, and not by the recorded schema."""
    return frozenset() if recorded == here else frozenset(_added(json.loads(recorded or b"{}"), json.loads(here)))


def _added(recorded: Any, here: Any) -> Iterator[str]:
    if isinstance(recorded, dict) and isinstance(here, dict):
        for key, value in here.items():
            if key == "properties":
                yield from (name for name in value if name not in recorded.get(key, {}))
            if key in recorded:
                yield from _added(recorded[key], value)
    elif isinstance(recorded, list) and isinstance(here, list):
        for one, other in zip(recorded, here, strict=False):
            yield from _added(one, other)


def missing_fields(data: bytes, message: Message) -> Iterator[str]:
    """The names of the fields of `message` that its JSON in `data` does not say."""
    said, whole = msgspec.json.decode(data), msgspec.json.decode(msgspec.json.encode(message))
    return iter(()) if said == whole else _missing(said, whole)


def _missing(said: Any, whole: Any) -> Iterator[str]:
    if isinstance(said, dict) and isinstance(whole, dict):
        yield from (key for key in whole if key not in said)
        for key in said.keys() & whole.keys():
            yield from _missing(said[key], whole[key])
    elif isinstance(said, list) and isinstance(whole, list):
        for one, other in zip(said, whole, strict=False):
            yield from _missing(one, other)


def _other_fields(recorded: bytes, here: bytes) -> str:
    """The fields at the top that only one of two schemas has, or that some within differ."""
    ours, theirs = (set(json.loads(schema or b"{}").get("properties", {})) for schema in (here, recorded))
    new, gone = sorted(ours - theirs), sorted(theirs - ours)
    parts = [f"new {', '.join(new)}"] if new else []
    parts += [f"no longer {', '.join(gone)}"] if gone else []
    return "; ".join(parts) or "a field within has changed"
