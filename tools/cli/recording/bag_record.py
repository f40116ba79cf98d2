"""`gemelo bag record`: chosen topics into files of one's own, beside what the logger records anyway."""

from __future__ import annotations

from collections.abc import Callable
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType

from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.mcap_file import McapFile
from gemelo.libraries.recordings.origin import metadata_of
from gemelo.libraries.recordings.subscriptions import Subscriptions
from gemelo.libraries.recordings.table import recorded_topics
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.message import Message
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import DESCRIPTION, Delivery, Topic
from gemelo.tools.cli.common.errors import ExitCode, unknown
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import CommandSession, connect
from gemelo.tools.cli.parser import Options, Parser, positive_number
from gemelo.tools.cli.recording.bag import one_sentence

COMPRESSIONS = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}
WRITE_RATE = 2.0  # [Hz]
FOUND_WITHIN = 8.0  # [s] users' nodes are known after their first statistics and one question


def add_options(parser: Parser) -> None:
    """Adds topics, output, compression, sizes and duration."""
    parser.add_argument("topics", metavar="TOPIC", nargs="*", help="topics or patterns, as 'device/*' [all]")
    names = "of the files, which get .mcap, or _1.mcap, _2.mcap where they are split [recording]"
    parser.add_argument("-o", "--output", type=Path, default=Path("recording"), metavar="NAME", help=names)
    parser.add_argument("--compression", default="zstd", metavar="HOW", help=f"{', '.join(COMPRESSIONS)} [zstd]")
    parser.add_argument("--max-mb", type=positive_number, metavar="MB", help="begin another file after so many MB")
    parser.add_argument("--max-minutes", type=positive_number, metavar="MIN", help="or after so many minutes")
    parser.add_argument("-d", "--duration", type=positive_number, metavar="S", help="[s] [until Ctrl-C]")


def run(options: Options) -> ExitCode:
    """Records until Ctrl-C."""
    if options.compression not in COMPRESSIONS:
        raise unknown("compression", options.compression, list(COMPRESSIONS))
    with connect() as session, one_sentence():
        record(session, options)
    return ExitCode.OK


class Files:
    """The file that is being written, and those before it; each begins with what is latched."""

    def __init__(self, session: CommandSession, options: Options) -> None:
        self.written: list[Path] = []
        self.messages = 0
        self._session, self._options = session, options
        self._latched: dict[tuple[str, str], Entry] = {}
        self._waiting: list[Entry] = []
        self._file = self._open(0)

    def take(self, topic: Topic[Any], message: Message) -> None:
        """One message that has just arrived."""
        entry = Entry(topic, message, self._session.node.now())
        if topic.delivery is Delivery.LATCHED:
            self._latched[topic.key, getattr(message, "node", "")] = entry
        self._waiting.append(entry)

    def write(self, now: int) -> None:
        """Writes what waits; begins another file where this one is large or old. Raises OSError of the disk."""
        if self._is_over(now):
            self._file.close()
            self._file = self._open(now)
            self._file.write(Entry(each.topic, each.message, now) for each in self._latched.values())
        waiting, self._waiting = self._waiting, []
        self._file.write(waiting)
        self.messages += len(waiting)

    def close(self) -> None:
        self._file.close()

    def _open(self, now: int) -> McapFile:
        session, options = self._session, self._options
        is_split = options.max_mb or options.max_minutes
        number = f"_{len(self.written) + 1}" if is_split else ""
        path = options.output.with_name(f"{options.output.name.removesuffix('.mcap')}{number}.mcap")
        path.parent.mkdir(parents=True, exist_ok=True)
        metadata = metadata_of(session.node.robot, session.deployment, project_root())
        self._started = now or session.node.now()
        file = McapFile(path, metadata, (), COMPRESSIONS[options.compression])
        self.written.append(path)
        return file

    def _is_over(self, now: int) -> bool:
        options, age = self._options, (now - self._started) / 60e9
        return bool(
            (options.max_mb and self._file.size >= options.max_mb * 1e6)
            or (options.max_minutes and age >= options.max_minutes)
        )


def record(session: CommandSession, options: Options) -> None:
    """Writes until the node is stopped or the time is over; raises `CommandError` for a pattern without a topic."""
    files = Files(session, options)
    node = session.node
    began = node.monotonic()
    subscriptions = Subscriptions(node, files.take, chosen_by(options.topics))
    unmatched = unmatched_of(options.topics)

    def step(now: int) -> None:
        nonlocal unmatched
        files.write(now)
        passed = node.monotonic() - began
        unmatched = [each for each in unmatched if not any(fnmatchcase(key, each) for key in subscriptions.others)]
        if unmatched and passed > FOUND_WITHIN:
            known = [*(topic.key for topic in recorded_topics()), *subscriptions.others]
            raise unknown("topic", unmatched[0], known)
        if options.duration is not None and passed >= options.duration:
            node.stop()

    try:
        node.spin(step, rate=WRITE_RATE)
        files.write(node.now())
    finally:
        files.close()
        written = because("cli.record.written", count=files.messages, files=tuple(map(str, files.written)))
        print(sentence(written), flush=True)


def chosen_by(patterns: list[str]) -> Callable[[str], bool]:
    """True for the topics that match; the robot's description is always recorded, so that the file can be played."""
    return lambda key: not patterns or key == DESCRIPTION.key or any(fnmatchcase(key, each) for each in patterns)


def unmatched_of(patterns: list[str]) -> list[str]:
    """Those that no topic of the table matches: they may be of a user's node."""
    keys = [topic.key for topic in recorded_topics()]
    return [each for each in patterns if not any(fnmatchcase(key, each) for key in keys)]
