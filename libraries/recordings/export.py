"""A recording as CSV, as Parquet, or as a file of Rerun."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

from gemelo.libraries.recordings.reader import RecordingReader
from gemelo.libraries.recordings.rerun_file import write_rerun
from gemelo.libraries.recordings.series import Series, series_of
from gemelo.libraries.runtime.process.own_files import own_file, own_folder
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import because, remedy

Written = tuple[Path, int]  # a file, and its rows


class NothingToExport(ReasonedError, ValueError):
    """Patterns that match no topic of a recording; the reason names those that it has."""


def export(file: Path, form: str, patterns: Sequence[str], output: Path | None) -> Iterator[Written]:
    """Writes the topics that match, all without patterns; raises `BadRecording`, `NothingToExport`, OSError."""
    reader = RecordingReader(file)
    reader.require_own()
    topics = chosen(topics_in(reader), patterns)
    if form == ROS2:
        from gemelo.libraries.recordings.ros2_bag import EXPORTED, write_ros2  # slow to load, of the extra `ros`

        if not topics & EXPORTED.keys():
            raise NothingToExport(because("recording.no_ros2", names=tuple(EXPORTED)))
        yield from write_ros2(reader, topics, output or file.with_suffix(""))
        return
    series = series_of(reader, topics)
    yield from FORMS[form](reader, series, output or file.with_suffix(SUFFIXES.get(form, "")))


def topics_in(reader: RecordingReader) -> list[str]:
    """The topics that have a message."""
    return sorted({row.channel.topic for row in reader.rows() if not row.is_derived})


def chosen(topics: Sequence[str], patterns: Sequence[str]) -> set[str]:
    """The topics that match one of `patterns`, all where there is none; raises `NothingToExport` for one of no use."""
    for pattern in patterns:
        if not any(fnmatchcase(topic, pattern) for topic in topics):
            hint = remedy("there_is", names=", ".join(topics)) if topics else remedy("there_is_none")
            raise NothingToExport(because("recording.no_topic", hint, pattern=pattern))
    return {topic for topic in topics if not patterns or any(fnmatchcase(topic, pattern) for pattern in patterns)}


def file_name(topic: str) -> str:
    """A topic as the name of a file: `device/state` is device.state."""
    return topic.lstrip("@").replace("/", ".")


def _csv(reader: RecordingReader, series: dict[str, Series], folder: Path) -> Iterator[Written]:
    own_folder(folder)
    for each in series.values():
        path = folder / f"{file_name(each.topic)}.csv"
        with open(path, "x", encoding="utf-8", newline="", opener=own_file) as file:
            writer = csv.DictWriter(file, list(each.columns), restval="", lineterminator="\n")
            writer.writeheader()
            writer.writerows(each.rows)
        yield path, len(each.rows)


def _parquet(reader: RecordingReader, series: dict[str, Series], folder: Path) -> Iterator[Written]:
    import pyarrow  # slow to load; it comes with rerun-sdk
    import pyarrow.parquet

    own_folder(folder)
    for each in series.values():
        path = folder / f"{file_name(each.topic)}.parquet"
        columns = {name: pyarrow.array(_column(each, name)) for name in each.columns}
        with open(path, "xb", opener=own_file) as file:
            pyarrow.parquet.write_table(pyarrow.table(columns), file)
        yield path, len(each.rows)


def _column(series: Series, name: str) -> list[object]:
    """The cells of one column, of one type: numbers as floats where any is one, else words where any is one."""
    column = [row.get(name) for row in series.rows]
    kinds = {type(cell) for cell in column if cell is not None}
    if len(kinds) <= 1:
        return list(column)
    cast: Callable[[object], object] = float if kinds <= {int, float} else str  # type: ignore[assignment]
    return [None if cell is None else cast(cell) for cell in column]


def _rerun(reader: RecordingReader, series: dict[str, Series], file: Path) -> Iterator[Written]:
    with open(file, "xb", opener=own_file):  # the name is free, and the disk takes it
        pass
    write_rerun(reader, series, file)
    yield file, 0


FORMS: dict[str, Callable[[RecordingReader, dict[str, Series], Path], Iterator[Written]]] = {
    "csv": _csv,
    "parquet": _parquet,
    "rerun": _rerun,
}
ROS2 = "ros2"  # a bag of ROS 2
SUFFIXES = {"rerun": ".rrd"}
