"""`gemelo bag`: what is in a recording, repairing one, and writing one as tables or for Rerun."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from gemelo.libraries.recordings.contents import Contents, WriterClock, contents_of
from gemelo.libraries.recordings.export import FORMS, NothingToExport, export
from gemelo.libraries.recordings.reader import BadRecording
from gemelo.libraries.recordings.repair import repair
from gemelo.libraries.runtime.clock_offset import ClockOffset
from gemelo.tools.cli.common.errors import CommandError, ExitCode, unknown, usage
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.parser import Options, Parser, json_option


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
            print(f"{options.file} is whole: there is nothing to repair")
            return ExitCode.OK
        target = options.output or options.file.with_suffix(".repaired.mcap")
        print("\n".join(repair(options.file, target).sentences))
    return ExitCode.OK


def export_options(parser: Parser) -> None:
    """Adds file, topics, form and output."""
    file_option(parser)
    parser.add_argument("topics", metavar="TOPIC", nargs="*", help="topics or patterns, as 'device/*' [all]")
    parser.add_argument("--to", default="csv", metavar="FORM", help=f"{', '.join(FORMS)} [csv]")
    parser.add_argument("-o", "--output", type=Path, metavar="PATH", help="folder, or the .rrd file [beside it]")


def run_export(options: Options) -> ExitCode:
    """Writes a recording's topics as tables, or as a file of Rerun."""
    if options.to not in FORMS:
        raise unknown("form", options.to, list(FORMS))
    with one_sentence():
        for path, count in export(options.file, options.to, options.topics, options.output):
            print(f"{path}: {count} rows" if count else f"{path}")
    return ExitCode.OK


@contextmanager
def one_sentence() -> Iterator[None]:
    """Raises what is wrong with a file as a `CommandError`."""
    try:
        yield
    except (BadRecording, NothingToExport) as error:
        raise usage(error) from error
    except FileExistsError as error:
        raise CommandError(f'"{error.filename}" is there already: name another with -o, or remove it') from error
    except OSError as error:
        raise CommandError(
            f"{error.filename or 'the disk'}: {error.strerror or error}; free space or name another place with -o"
        ) from error


def _apart(contents: Contents) -> Iterator[tuple[str, WriterClock, ClockOffset]]:
    """The writers whose clocks were others than the recorder's."""
    for name, each in contents.clocks.items():
        if each.offset is not None and not (clock := ClockOffset(each.offset, each.bound)).may_agree:
            yield name, each, clock


def information(contents: Contents) -> str:
    """A recording as text."""
    start = f"{datetime.fromtimestamp(contents.start / 1e9, UTC):%Y-%m-%d %H:%M:%S} UTC" if contents.start else "-"
    head = [
        f"file      {contents.file}, {contents.size / 1e6:.2f} MB",
        f"start     {start}, {contents.duration:.1f} s",
        f"messages  {contents.messages} on {len(contents.topics)} topics",
        "versions  " + ", ".join(f"{name} {value}" for name, value in contents.versions.items() if name != "system"),
    ]
    head += [
        f"clock     of {name} on {each.host}: {clock} from the recorder's" for name, each, clock in _apart(contents)
    ]
    head += [f"damaged   {contents.damage}"] if contents.damage else []
    rows = [(each.topic, each.message, str(each.count), f"{each.rate:.2f}") for each in contents.topics]
    return "\n".join([*head, "", table(("topic", "message", "count", "rate [Hz]"), rows)])
