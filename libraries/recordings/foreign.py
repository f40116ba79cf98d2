"""Recordings of other programs: how our own differ from them, what they are, and which program reads them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gemelo.schemas.reasons import Reason, because, remedy

PROFILE = "gemelo"  # of the header of our own recordings
METADATA = "gemelo"  # the name of their metadata record of versions
MOST_NAMED = 3  # topics
ROS2, ROS1, OTHER = remedy("play_with_ros2"), remedy("convert_rosbags"), remedy("show_in_foxglove")
KINDS = {"cdr": ROS2, "ros1": ROS1}  # by the encoding of its messages, what to do
ENCODINGS = (*KINDS, "json", "protobuf", "flatbuffer", "cbor", "msgpack")  # as `word.recording` names them
BEGINNINGS = {  # of files that are no MCAP: what it is by `word.recording`, and what to do
    b"#ROSBAG": ("rosbag", ROS1),
    b"SQLite ": ("rosbag2", remedy("convert_rosbag2")),
    b"\x89MCAP0": ("mcap", OTHER),
}


def reason_of(path: Path, encodings: set[str], topics: Sequence[str]) -> Reason:
    """What a recording is whose messages have these encodings, and what to do with it."""
    known = next((each for each in ENCODINGS if each in encodings), "")
    named = ", ".join(topics[:MOST_NAMED]) + (" ..." if len(topics) > MOST_NAMED else "")
    mend, file = KINDS.get(known, OTHER), str(path)
    if not known:
        return because("recording.foreign.unknown", mend, file=file, encoding=min(encodings), topics=named)
    if others := tuple(sorted(encodings - {known})):
        return because("recording.foreign.more", mend, file=file, kind=known, others=others, topics=named)
    return because("recording.foreign", mend, file=file, kind=known, topics=named)


def kind_of(path: Path) -> Reason | None:
    """What a file is that is no MCAP, with what to do, or a folder of rosbag2; None where it is not known."""
    if (path / "metadata.yaml").is_file():
        inside = sorted(each.name for each in path.glob("*.mcap")) or sorted(each.name for each in path.glob("*.db3*"))
        if inside:
            return because("recording.rosbag2.files", ROS2, file=str(path), files=tuple(inside[:MOST_NAMED]))
        return because("recording.rosbag2", ROS2, file=str(path))
    try:
        with path.open("rb") as file:
            begin = file.read(16)
    except OSError:
        return None
    for first, (kind, mend) in BEGINNINGS.items():
        if begin.startswith(first):
            return because("recording.other_form", mend, file=str(path), kind=kind)
    return None
