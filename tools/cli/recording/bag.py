"""`gemelo bag`: what is in a recording, repairing one, and writing one as tables or for Rerun."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from gemelo.libraries.recordings.contents import Contents, WriterClock, contents_of
from gemelo.libraries.recordings.export import FORMS, ROS2, NothingToExport, export
from gemelo.libraries.recordings.reader import BadRecording
from gemelo.libraries.recordings.repair import repair
from gemelo.libraries.runtime.clock_offset import ClockOffset
from gemelo.schemas.reasons import because, plain
from gemelo.tools.cli.common.errors import CommandError, ExitCode, unknown, usage
from gemelo.tools.cli.common.language import columns, sentence, word
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.common.units import positive_seconds
from gemelo.tools.cli.parser import Options, Parser, json_option

MOST = 1000.0  # [Hz] or [s] chosen: of a rate or of a pause that can be meant
SLOW = 0.9  # of a dataset's rate: images that come less often are repeated


def file_option(parser: Parser) -> None:
    """Adds the recording."""
    parser.add_argument("file", metavar="FILE", type=Path, help="a recording, as out/recordings/....mcap")


def info_options(parser: Parser) -> None:
    """Adds file and --json."""
    file_option(parser)
    json_option(parser)


def run_info(options: Options) -> ExitCode:
    """Prints what is in a recording."""
    with one_sentence():
        contents = contents_of(options.file)
    print(msgspec.json.encode(contents).decode() if options.json else information(contents))
    return ExitCode.OK


def repair_options(parser: Parser) -> None:
    """Adds file and --output."""
    file_option(parser)
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="[beside it, as <name>.repaired.mcap]")


def run_repair(options: Options) -> ExitCode:
    """Writes what is readable of a recording that was cut off."""
    with one_sentence():
        if not contents_of(options.file).damage:
            print(sentence(because("recording.whole", file=str(options.file))))
            return ExitCode.OK
        target = options.output or options.file.with_suffix(".repaired.mcap")
        print("\n".join(map(sentence, repair(options.file, target).reasons)))
    return ExitCode.OK


def export_options(parser: Parser) -> None:
    """Adds file, topics, form and output."""
    file_option(parser)
    parser.add_argument("topics", metavar="TOPIC", nargs="*", help="topics or patterns, as 'device/*' [all]")
    parser.add_argument("--to", default="csv", metavar="FORM", help=f"{', '.join(FORMS)} [csv]")
    parser.add_argument("-o", "--output", type=Path, metavar="PATH", help="folder, or the .rrd file [beside it]")
    parser.add_argument("--lerobot", type=Path, metavar="DIR", help="a new folder: demonstrations as a LeRobotDataset")
    parser.add_argument("--task", metavar="TEXT", help="what the demonstrations show, as a LeRobotDataset says it")
    parser.add_argument("--fps", type=float, default=30.0, metavar="HZ", help="frames of a LeRobotDataset [30]")
    parser.add_argument(
        "--gap", type=positive_seconds, default=1.0, metavar="TIME", help="a pause that ends an episode [1s]"
    )
    parser.add_argument("--each-goal", action="store_true", help="an episode is one goal, not all up to a pause")
    parser.add_argument("--ros2", type=Path, metavar="FOLDER", help="a bag of ROS 2 there: MCAP with its messages")


def run_export(options: Options) -> ExitCode:
    """Writes topics as tables, a file of Rerun or a bag of ROS 2, or demonstrations as a LeRobotDataset."""
    if options.lerobot is not None:
        return _export_dataset(options)
    if options.to not in FORMS:
        raise unknown("form", options.to, list(FORMS))
    form, output = (ROS2, options.ros2) if options.ros2 is not None else (options.to, options.output)
    with one_sentence():
        for path, count in export(options.file, form, options.topics, output):
            print(sentence(because("recording.exported", file=str(path), count=count)) if count else str(path))
    return ExitCode.OK


def _export_dataset(options: Options) -> ExitCode:
    from gemelo.libraries.lerobot.export import export_dataset  # slow to load: pyarrow

    if not options.task:
        raise usage(because("recording.lerobot.task"))
    for name, value in (("--fps", options.fps), ("--gap", options.gap)):
        if not 0.0 < value <= MOST:
            raise usage(because("recording.lerobot.range", option=name, value=value, most=MOST))
    with one_sentence():
        done = export_dataset(options.file, options.lerobot, options.task, options.fps, options.gap, options.each_goal)
    folder = str(options.lerobot)
    print(sentence(because("recording.lerobot.written", folder=folder, count=done.episodes, frames=done.frames)))
    if done.left_out:
        print(sentence(because("recording.lerobot.short", count=done.left_out)))
    for name, rate in done.cameras.items():
        if rate < SLOW * options.fps:
            print(sentence(because("recording.lerobot.slow", camera=name, rate=rate, fps=options.fps)))
    return ExitCode.OK


@contextmanager
def one_sentence() -> Iterator[None]:
    """Raises what is wrong with a file as a `CommandError`."""
    try:
        yield
    except (BadRecording, NothingToExport) as error:
        raise usage(error) from error
    except FileExistsError as error:
        raise CommandError(because("recording.there_already", file=str(error.filename))) from error
    except OSError as error:
        said = str(error.strerror or error)
        where = because("recording.place", file=str(error.filename), error=said) if error.filename else because(
            "recording.disk", error=said
        )  # fmt: skip
        raise CommandError(where) from error


def _apart(contents: Contents) -> Iterator[tuple[str, WriterClock, ClockOffset]]:
    """The writers whose clocks were others than the recorder's."""
    for name, each in contents.clocks.items():
        if each.offset is not None and not (clock := ClockOffset(each.offset, each.bound)).may_agree:
            yield name, each, clock


def information(contents: Contents) -> str:
    """A recording as text."""
    start = f"{datetime.fromtimestamp(contents.start / 1e9, UTC):%Y-%m-%d %H:%M:%S} UTC" if contents.start else "-"
    versions = ", ".join(f"{name} {value}" for name, value in contents.versions.items() if name != "system")
    clocks = (
        because("recording.line.clock", node=name, host=each.host, clock=str(clock))
        for name, each, clock in _apart(contents)
    )
    lines = [
        ("file", because("recording.line.file", file=contents.file, size=contents.size / 1e6)),
        ("start", because("recording.line.start", start=start, duration=contents.duration)),
        ("messages", because("recording.line.messages", count=contents.messages, topics=len(contents.topics))),
        ("versions", plain(versions)),
        *(("clock", each) for each in clocks),
        *((("damaged", contents.damage_why),) if contents.damage_why is not None else ()),
    ]
    head = [f"{word('recording_line', name):<9} {sentence(what)}" for name, what in lines]
    rows = [(each.topic, each.message, str(each.count), f"{each.rate:.2f}") for each in contents.topics]
    return "\n".join([*head, "", table(columns("topic", "message", "count", "rate [Hz]"), rows)])
