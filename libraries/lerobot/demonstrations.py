"""Demonstrations in a recording: states, commands, targets, the gripper and images, each by its own time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import msgspec
import numpy as np

from gemelo.libraries.recordings.contents import WriterClock
from gemelo.libraries.recordings.foxglove import CAMERA, IMAGE
from gemelo.libraries.recordings.foxglove_schemas import Time
from gemelo.libraries.recordings.mcap_file import CLOCKS
from gemelo.libraries.recordings.reader import RecordingReader
from gemelo.libraries.runtime.actions import keys
from gemelo.schemas.gripper import GripperState
from gemelo.schemas.joints import JointState, JointTargets
from gemelo.schemas.topics import (
    FOLLOW_JOINT_TRAJECTORY,
    GATEWAY,
    GRIPPER_COMMAND,
    GRIPPER_STATE,
    JOINT_COMMANDS,
    JOINT_STATES,
    JOINT_TARGETS,
)

Array = np.ndarray[Any, np.dtype[np.float64]]
GOAL, GRIP = (keys.feedback_topic(each).key for each in (FOLLOW_JOINT_TRAJECTORY, GRIPPER_COMMAND))
IMAGES = (CAMERA.format(""), f"/{IMAGE}")  # before and behind the name of a camera
TRACKS = (JOINT_STATES.key, JOINT_COMMANDS.key)
SECOND = 1_000_000_000  # [ns]


class _Feedback(msgspec.Struct):
    goal_id: str = ""


class _Image(msgspec.Struct):
    timestamp: Time
    data: bytes


@dataclass
class Track:
    """Rows (n,) at times [ns], in the order of their times."""

    times: list[int] = field(default_factory=list)
    rows: list[Sequence[float]] = field(default_factory=list)

    def add(self, time: int, row: Sequence[float]) -> None:
        """A row (n,) at `time` [ns]; one that is not newer than the last is left out."""
        if not self.times or time > self.times[-1]:
            self.times.append(time)
            self.rows.append(row)

    def between(self, times: Array) -> Array:
        """The rows (m, n) at `times` (m,) [ns], on straight lines between those that are there."""
        known, rows = np.asarray(self.times, float), np.asarray(self.rows, float)
        return np.stack([np.interp(times, known, column) for column in rows.T], axis=1)

    def held(self, times: Array) -> Array:
        """The newest row (m, n) at each of `times` (m,) [ns]; the first before that."""
        return np.take(np.asarray(self.rows, np.float64), self.newest(times), axis=0)

    def newest(self, times: Array) -> np.ndarray[Any, np.dtype[np.int64]]:
        """The index (m,) of the newest row at each of `times` (m,) [ns]; 0 before the first."""
        found = np.searchsorted(np.asarray(self.times), times, side="right") - 1
        return np.maximum(found, 0).astype(np.int64)


@dataclass
class Demonstrations:
    """All times [ns] by the clock of the recorder."""

    states: Track = field(default_factory=Track)  # [rad] or [m], in the arm's order
    commands: Track = field(default_factory=Track)
    targets: dict[str, Track] = field(default_factory=dict)  # by joint
    gripper: Track = field(default_factory=Track)  # [m] position and target
    images: dict[str, tuple[Track, list[bytes]]] = field(default_factory=dict)  # JPEGs, by camera
    moved: list[int] = field(default_factory=list)  # times at which something asked the arm to move
    goals: dict[str, tuple[int, int]] = field(default_factory=dict)  # first and last time, by goal


def read_demonstrations(reader: RecordingReader, joints: Sequence[str]) -> Demonstrations:
    """Reads the whole file; `joints` in the arm's order."""
    found = Demonstrations()
    readers: dict[str, Callable[[bytes, int], None]] = {
        JOINT_STATES.key: _joint_states(found.states, joints),
        JOINT_COMMANDS.key: _joint_states(found.commands, joints),
        JOINT_TARGETS.key: _joint_targets(found),
        GRIPPER_STATE.key: _gripper(found.gripper),
        GOAL: _goals(found),
        GRIP: lambda data, arrived: found.moved.append(arrived),
    }

    def is_wanted(topic: str) -> bool:
        return topic in readers or _camera(topic) != ""

    for row in reader.rows(is_wanted):
        read = readers.get(row.channel.topic)
        if read is None:
            read = readers[row.channel.topic] = _images(found, _camera(row.channel.topic))
        read(row.message.data, row.message.log_time)
    _by_one_clock(found, reader.metadata.get(CLOCKS, {}))
    return found


def _camera(topic: str) -> str:
    before, behind = IMAGES
    return topic[len(before) : -len(behind)] if topic.startswith(before) and topic.endswith(behind) else ""


def _joint_states(track: Track, joints: Sequence[str]) -> Callable[[bytes, int], None]:
    decoder = msgspec.json.Decoder(JointState)

    def read(data: bytes, arrived: int) -> None:
        message = decoder.decode(data)
        values = dict(zip(message.name, message.position, strict=True))
        if all(name in values for name in joints):
            track.add(message.stamp or arrived, [values[name] for name in joints])

    return read


def _joint_targets(found: Demonstrations) -> Callable[[bytes, int], None]:
    """By their arrival: whose clock has stamped them is not known."""
    decoder = msgspec.json.Decoder(JointTargets)

    def read(data: bytes, arrived: int) -> None:
        message = decoder.decode(data)
        found.moved.append(arrived)
        for name, value in zip(message.name, message.position, strict=True):
            found.targets.setdefault(name, Track()).add(arrived, [value])

    return read


def _gripper(track: Track) -> Callable[[bytes, int], None]:
    decoder = msgspec.json.Decoder(GripperState)

    def read(data: bytes, arrived: int) -> None:
        message = decoder.decode(data)
        if message.known:
            track.add(message.stamp or arrived, [message.position, message.target])

    return read


def _goals(found: Demonstrations) -> Callable[[bytes, int], None]:
    decoder = msgspec.json.Decoder(_Feedback)

    def read(data: bytes, arrived: int) -> None:
        goal = decoder.decode(data).goal_id
        first, _ = found.goals.get(goal, (arrived, arrived))
        found.goals[goal] = (first, arrived)
        found.moved.append(arrived)

    return read


def _images(found: Demonstrations, camera: str) -> Callable[[bytes, int], None]:
    decoder = msgspec.json.Decoder(_Image)
    track, pictures = found.images.setdefault(camera, (Track(), []))

    def read(data: bytes, arrived: int) -> None:
        image = decoder.decode(data)
        time = image.timestamp.sec * SECOND + image.timestamp.nsec
        if not track.times or time > track.times[-1]:
            track.add(time, ())
            pictures.append(image.data)

    return read


def _by_one_clock(found: Demonstrations, clocks: Mapping[str, str]) -> None:
    """Stamps of other hosts become times of the recorder's."""
    by_writer = {"camera": [track for track, _ in found.images.values()]}
    by_writer[GATEWAY] = [found.states, found.commands, found.gripper]
    for writer, tracks in by_writer.items():
        text = clocks.get(writer, "")
        offset = msgspec.json.decode(text, type=WriterClock).offset if text else None
        for track in tracks if offset else ():
            track.times = [time - round((offset or 0.0) * SECOND) for time in track.times]
