"""The findings of a check of a robot's folder."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum

import msgspec

from gemelo.libraries.arm.errors import Subject
from gemelo.schemas.reasons import Reason, because, say


class Severity(StrEnum):
    """An error must be corrected before the arm moves; a warning is reported only; a note is nothing wrong."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True)
class Finding:
    """One mistake: its subject, and what is wrong with the value and the remedies."""

    severity: Severity
    file: str
    of: Subject
    what: Reason
    line: int = 0  # of the file, from 1; 0 where it is of no line
    also: tuple[int, ...] = ()  # further lines of the same mistake

    @property
    def subject(self) -> str:
        """In English."""
        return str(self.of)

    @property
    def message(self) -> str:
        """What is wrong, in English, without the remedy."""
        return str(without_remedies(self.what))

    @property
    def remedy(self) -> str:
        """In English; empty where none is known."""
        return say(because("finding.remedy", *self.what.remedies)) if self.what.remedies else ""

    @property
    def reason(self) -> Reason:
        """All of it, with its place."""
        found, remedies = self.of.around(without_remedies(self.what)), self.what.remedies
        where = {"severity": str(self.severity), "file": self.file}
        if self.also:
            before = ", ".join(map(str, (self.line, *self.also[:-1])))
            code = "finding.at_lines.mend" if remedies else "finding.at_lines"
            return because(code, found, *remedies, **where, lines_before=before, last=self.also[-1])
        if self.line:
            code = "finding.at_line.mend" if remedies else "finding.at_line"
            return because(code, found, *remedies, **where, line=self.line)
        return because("finding.in_file.mend" if remedies else "finding.in_file", found, *remedies, **where)

    def __str__(self) -> str:
        return str(self.reason)


def without_remedies(reason: Reason) -> Reason:
    """The reason alone."""
    return msgspec.structs.replace(reason, remedies=())


def once(findings: Iterable[Finding]) -> list[Finding]:
    """Each mistake once, at its first place, with all its lines: most are in <visual> and in <collision>."""
    found: dict[bytes, tuple[Finding, list[int]]] = {}
    for each in findings:
        key = msgspec.json.encode(replace(each, line=0, also=()))
        _, lines = found.setdefault(key, (each, []))
        lines += [line for line in (each.line, *each.also) if line not in lines]
    return [replace(each, line=lines[0], also=tuple(lines[1:])) for each, lines in found.values()]


def error(file: str, subject: Subject, what: Reason, line: int = 0) -> Finding:
    return Finding(Severity.ERROR, file, subject, what, line)


def note(file: str, subject: Subject, what: Reason, line: int = 0) -> Finding:
    return Finding(Severity.NOTE, file, subject, what, line)


def warning(file: str, subject: Subject, what: Reason, line: int = 0) -> Finding:
    return Finding(Severity.WARNING, file, subject, what, line)
