"""`make recordings`: the recordings that `make test` replays, made anew on a stack of its own with the virtual device.

Each is cut down to what the replay of one service needs, so that it stays small enough to be kept with the code.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
from mcap.records import Channel, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer

import gemelo
from gemelo.libraries.recordings.foreign import METADATA, PROFILE
from gemelo.libraries.recordings.mcap_file import DEPLOYMENT
from gemelo.libraries.recordings.reader import RecordingReader
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.topics import Topic
from gemelo.tools.replay.main import SERVICES, Replayed, replay, text_of
from gemelo.tools.stack.stack import Stack, StackError

FOLDER = "tests/replay/recordings"
CHUNK = 256 * 1024  # [B] uncompressed: larger ones are smaller together
BETWEEN = 2.0  # [s] chosen: a jog has come to rest, and the next one begins anew
LAST_WORDS = 1.5  # [s] for the logger's last batches


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="make recordings", description="the recordings that the tests replay")
    parser.add_argument("--out", type=Path, default=project_root() / FOLDER)
    options = parser.parse_args()
    try:
        sys.exit(make(options.out.resolve()))
    except StackError as error:
        sys.exit(f"recordings: {error}")


def make(out: Path) -> int:
    """Records, cuts, and replays what was written; returns the exit code."""
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="gemelo-recordings-") as folder:
        recording = record(Path(folder))
        for service, (topics, _) in SERVICES.items():
            cut(recording, out / f"{service}.mcap", topics)
    replays = [replay(out / f"{service}.mcap", service) for service in SERVICES]
    for each in replays:
        print(f"{text_of(each)}\n  {Path(each.file).stat().st_size / 1e3:.0f} kB", flush=True)
    return 0 if all(map(is_good, replays)) else 1


def is_good(replayed: Replayed) -> bool:
    """True if the replay is worth keeping: something is compared, and nothing differs."""
    return replayed.difference is None and bool(replayed.alike)


def record(folder: Path) -> Path:
    """The recording of `perform` that the logger of a stack leaves in `folder`."""
    with Stack(out=folder, processes=NEEDED) as stack:
        os.environ.update(stack.deployment)  # where the arm is found
        with gemelo.connect(name="recordings") as arm:
            perform(arm)
            time.sleep(LAST_WORDS)
    (found,) = (folder / "recordings").glob("*.mcap")
    return found


NEEDED = ("router", "broker", "virtual_esp32", "stepper_gateway", "state_publisher", "planner", "logger")


def perform(arm: gemelo.Arm) -> None:
    """Some seconds of everything that a core decides: goals of every kind, refusals, a scene, a stream, a cancel."""
    ready, left = arm.states["ready"], arm.states["left"]
    arm.move(named="ready")
    arm.line(offset=(0.0, 0.0, -0.02), speed=0.05)
    arm.plan(position=arm.fk(left).position)
    with suppress(gemelo.Refused):
        arm.plan(position=(3.0, 0.0, 0.1))  # beyond the arm's reach
    middle = {name: (ready[name] + left[name]) / 2.0 for name in ready}
    arm.scene.add_sphere("ball", radius=0.03, at=arm.fk(middle).position)
    with suppress(gemelo.Refused):
        arm.plan(joints=middle)
    with suppress(gemelo.Refused):
        arm.plan(joints=left, from_joints=ready, seed=3)  # around the ball
    with suppress(gemelo.Refused):
        arm.plan(joints=left, from_joints=ready, planner="RRTConnect", seed=5, allowed_time=10.0)
    with suppress(gemelo.Refused):
        arm.plan(joints=left, from_joints=ready, ptp=True)
    arm.scene.remove("ball")
    motion = arm.start(named="left")
    arm.wait_for(lambda: motion.progress > 0.3, 5.0)
    motion.cancel()
    with suppress(gemelo.Error):
        motion.wait()
    arm.move(named="ready", speed=0.7)
    ask(arm)
    jog(arm)


def ask(arm: gemelo.Arm) -> None:
    """Every question about a configuration, with answers of both kinds, and a scene edit that is refused."""
    ready, left = arm.states["ready"], arm.states["left"]
    arm.ik(position=arm.fk(left).position, solutions=4)
    arm.fk({arm.joint_names[0]: 0.2})  # the others as they stand
    arm.check(ready)
    for refused in ({arm.joint_names[0]: 30.0}, {arm.joint_names[-1]: -30.0}):
        with suppress(gemelo.Refused):
            arm.check(refused)
    with suppress(gemelo.Refused):
        arm.scene.remove("nothing")


def jog(arm: gemelo.Arm) -> None:
    """Against a wall by the tool, and, after a silence, one joint."""
    x, y, z = arm.fk().position
    arm.scene.add_box("wall", size=(0.3, 0.02, 0.3), at=(x, y + 0.12, z))
    with suppress(gemelo.Refused):
        arm.jog(twist=(0.0, 0.08, 0.0), duration=1.5)
    time.sleep(BETWEEN)
    arm.scene.remove("wall")
    arm.jog(joints={arm.joint_names[0]: -0.3}, duration=0.8)
    time.sleep(BETWEEN)


def cut(source: Path, target: Path, topics: Iterable[Topic[Any]]) -> None:
    """Writes the messages of `topics` and the metadata, without the folders of the machine that has recorded."""
    wanted, reader = {topic.key for topic in topics}, RecordingReader(source)
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    with target.open("wb") as file:
        writer = Writer(file, chunk_size=CHUNK, compression=CompressionType.ZSTD)
        writer.start(profile=PROFILE)
        for record in reader.records():
            match record:
                case Schema():
                    schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
                case Channel() if record.topic in wanted:
                    channels[record.id] = writer.register_channel(
                        record.topic, record.message_encoding, schemas[record.schema_id], dict(record.metadata)
                    )
                case Message() if record.channel_id in channels:
                    writer.add_message(
                        channels[record.channel_id], record.log_time, record.data, record.publish_time, record.sequence
                    )
                case Metadata():
                    writer.add_metadata(record.name, anonymous(record.name, dict(record.metadata)))
        writer.finish()


def anonymous(name: str, values: dict[str, str]) -> dict[str, str]:
    """A record of metadata without the name of the machine's system and without its folders."""
    match name:
        case _ if name == METADATA:
            return {key: value for key, value in values.items() if key != "system"}
        case _ if name == DEPLOYMENT:
            folder = Path(json.loads(values["json"])["robot"])
            return {"json": msgspec.json.encode({"robot": f"urdf/{folder.name}"}).decode()}
        case _:
            return values


if __name__ == "__main__":
    main()
