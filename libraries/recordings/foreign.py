"""Recordings of other programs: how our own differ from them, what they are, and which program reads them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

PROFILE = "gemelo"  # of the header of our own recordings
METADATA = "gemelo"  # the name of their metadata record of versions
MOST_NAMED = 3  # topics
ROS2 = "`ros2 bag play` plays it, and Foxglove or PlotJuggler shows it"
ROS1 = "`rosbags-convert` makes a ROS 2 recording of it, and Foxglove shows it"
OTHER = "Foxglove shows it, and the program that wrote it reads it"
KINDS = {  # by the encoding of its messages: what it is, and what to do
    "cdr": ("a recording of ROS 2 (CDR messages)", ROS2),
    "ros1": ("a recording of ROS 1", ROS1),
    "json": ("a recording of another program, in JSON", OTHER),
    "protobuf": ("a recording of another program, in protobuf", OTHER),
    "flatbuffer": ("a recording of another program, in FlatBuffers", OTHER),
    "cbor": ("a recording of another program, in CBOR", OTHER),
    "msgpack": ("a recording of another program, in MessagePack", OTHER),
}
BEGINNINGS = {  # of files that are no MCAP
    b"#ROSBAG": ("a recording of ROS 1 (rosbag)", ROS1),
    b"SQLite ": ("a recording of ROS 2 in SQLite (rosbag2)", "`ros2 bag convert` makes an MCAP of it, " + ROS2),
    b"\x89MCAP0": ("an MCAP of another version than 0 of the format", OTHER),
}


def sentence_of(encodings: set[str], topics: Sequence[str]) -> str:
    """What a recording is whose messages have these encodings, and what to do with it."""
    known = next((each for each in KINDS if each in encodings), "")
    unknown = f'a recording of another program, its messages "{min(encodings)}"'
    kind, remedy = KINDS.get(known, (unknown, OTHER))
    more = f", with {' and '.join(sorted(encodings - {known}))} messages too" if known and len(encodings) > 1 else ""
    named = ", ".join(topics[:MOST_NAMED]) + (" ..." if len(topics) > MOST_NAMED else "")
    return f"is {kind}{more}, of {named}, and none of gemelo: {remedy}"


def kind_of(path: Path) -> str:
    """What a file is that is no MCAP, with what to do, or a folder of rosbag2; empty where it is not known."""
    if (path / "metadata.yaml").is_file():
        inside = sorted(each.name for each in path.glob("*.mcap")) or sorted(each.name for each in path.glob("*.db3*"))
        said = f" with {', '.join(inside[:MOST_NAMED])}" if inside else ""
        return f"is the folder of a ROS 2 recording (rosbag2){said}: {ROS2}"
    try:
        with path.open("rb") as file:
            begin = file.read(16)
    except OSError:
        return ""
    return next((f"is {kind}: {remedy}" for first, (kind, remedy) in BEGINNINGS.items() if begin.startswith(first)), "")
