"""A recording as a bag of ROS 2: MCAP with messages in CDR, for `ros2 bag play`, PlotJuggler and others."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal, NamedTuple

import msgspec
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import StoragePlugin, Writer, WriterError

from gemelo.libraries.recordings.reader import RecordingReader
from gemelo.libraries.ros2 import messages
from gemelo.libraries.ros2.types import encode, ros_type, store
from gemelo.libraries.runtime.process.own_files import own_folder
from gemelo.schemas.frames import FrameTransforms, RobotDescription
from gemelo.schemas.joints import JointState
from gemelo.schemas.message import Message
from gemelo.schemas.system import LogRecord
from gemelo.schemas.topics import DESCRIPTION, FRAMES, JOINT_COMMANDS, JOINT_STATES, LOG, STATIC_FRAMES

VERSION: Literal[9] = 9  # of the bag's metadata: Jazzy and later read it
INFINITE = QosTime(0, 0)  # a duration of nothing: not asked for


class Out(NamedTuple):
    """One topic of the bag that a message of ours becomes a message of."""

    topic: str
    convert: Callable[[Any], Any]
    is_latched: bool = False


class Exported(NamedTuple):
    """What one of our topics becomes."""

    message: type[Message]
    out: tuple[Out, ...]


EXPORTED = {
    JOINT_STATES.key: Exported(JointState, (Out("/joint_states", messages.joint_state),)),
    JOINT_COMMANDS.key: Exported(JointState, (Out("/joint_commands", messages.joint_state),)),
    FRAMES.key: Exported(FrameTransforms, (Out("/tf", messages.frames),)),
    STATIC_FRAMES.key: Exported(FrameTransforms, (Out("/tf_static", messages.frames, True),)),
    DESCRIPTION.key: Exported(
        RobotDescription,
        (
            Out("/robot_description", lambda each: messages.string(each.urdf), True),
            Out("/robot_description_semantic", lambda each: messages.string(each.srdf), True),
        ),
    ),
    LOG.key: Exported(LogRecord, (Out("/rosout", messages.log_record),)),
}


def write_ros2(reader: RecordingReader, topics: set[str], folder: Path) -> Iterator[tuple[Path, int]]:
    """Writes those of the topics that ROS has a message for; yields each topic of the bag with its messages.

    Raises FileExistsError where the folder is there already.
    """
    if folder.exists():
        raise FileExistsError(17, "File exists", str(folder))
    own_folder(folder.parent)
    counts: Counter[str] = Counter()
    try:
        with Writer(folder, version=VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
            connections: dict[str, Any] = {}
            for row in reader.rows(lambda topic: topic in topics and topic in EXPORTED):
                exported = EXPORTED[row.channel.topic]
                with suppress(msgspec.DecodeError):
                    message = msgspec.json.decode(row.message.data, type=exported.message)
                    for out in exported.out:
                        converted = out.convert(message)
                        if out.topic not in connections:
                            connections[out.topic] = _connection(writer, out, converted.__msgtype__)
                        writer.write(connections[out.topic], row.message.log_time, encode(converted))
                        counts[out.topic] += 1
    except WriterError as error:
        raise OSError(5, str(error), str(folder)) from error
    yield from ((folder / topic.lstrip("/"), count) for topic, count in sorted(counts.items()))


def _connection(writer: Writer, out: Out, kind: str) -> Any:
    durability = QosDurability.TRANSIENT_LOCAL if out.is_latched else QosDurability.VOLATILE
    qos = Qos(
        QosHistory.KEEP_LAST, 1 if out.is_latched else 10, QosReliability.RELIABLE, durability, INFINITE, INFINITE,
        QosLiveliness.AUTOMATIC, INFINITE, False,
    )  # fmt: skip
    definition, _ = store().generate_msgdef(kind, ros_version=2)
    return writer.add_connection(
        out.topic, kind, msgdef=definition, rihs01=ros_type(kind).hash, offered_qos_profiles=[qos]
    )
