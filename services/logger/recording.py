"""One recording: an MCAP of messages and a CSV of commands that begin and end together."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from typing import IO

from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.mcap_file import McapFile
from gemelo.libraries.recordings.table import recorded_topics
from gemelo.libraries.runtime.process.own_files import created
from gemelo.services.logger.command_log import CommandRow, Row, header
from gemelo.services.logger.files import CSV, MCAP


class Recording:
    """The open files; every method raises OSError when the disk refuses, and the recording is then spent."""

    def __init__(self, folder: Path, stem: str, metadata: dict[str, dict[str, str]]) -> None:
        """`metadata` by the name of its record."""
        self.path = folder / (stem + MCAP)
        self.csv_path = folder / (stem + CSV)
        self._tables: dict[tuple[str, ...], IO[str]] = {}
        self._mcap = McapFile(self.path, metadata, recorded_topics())

    @property
    def size(self) -> int:
        """[B] of the MCAP on disk."""
        return self._mcap.size

    def write(self, entries: Iterable[Entry]) -> None:
        """Adds messages, and makes them survive this process."""
        self._mcap.write(entries)

    def write_lines(self, lines: Iterable[CommandRow]) -> None:
        """Adds commands, each to the table of its joints."""
        for joints, group in groupby(lines, key=lambda line: line.joints):
            table = self._tables.get(joints) or self._begin_table(joints)
            table.write(_csv(line.cells for line in group))
            table.flush()

    def close(self) -> None:
        """Ends the files properly."""
        try:
            self._mcap.close()
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Lets go of files that the disk no longer takes."""
        self._mcap.abandon()
        for file in self._tables.values():
            with suppress(OSError):
                file.close()

    def _begin_table(self, joints: tuple[str, ...]) -> IO[str]:
        """A table begins with its first command, when the joints are known; other joints get one of their own."""
        number = f"_{len(self._tables) + 1}" if self._tables else ""
        path = self.csv_path.with_name(self.csv_path.stem + number + CSV)
        table = self._tables[joints] = io.TextIOWrapper(created(path), encoding="utf-8", newline="")
        table.write(_csv([header(joints)]))
        return table


def _csv(rows: Iterable[Row]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()
