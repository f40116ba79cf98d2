"""The findings of a check of a robot's folder."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum


class Severity(StrEnum):
    """An error must be corrected before the arm moves; a warning is reported only; a note is nothing wrong."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True)
class Finding:
    """One mistake: its subject, a sentence with the value, and the remedy."""

    severity: Severity
    file: str
    subject: str  # for example: joint "brazo_joint"
    message: str
    remedy: str = ""
    line: int = 0  # of the file, from 1; 0 where it is of no line
    also: tuple[int, ...] = ()  # further lines of the same mistake

    def __str__(self) -> str:
        remedy = f" -> {self.remedy}" if self.remedy else ""
        line = f", line {self.line}" if self.line else ""
        if self.also:
            line = f", lines {', '.join(map(str, (self.line, *self.also[:-1])))} and {self.also[-1]}"
        return f"{self.severity}: {self.file}{line}: {self.subject}: {self.message}{remedy}"


def once(findings: Iterable[Finding]) -> list[Finding]:
    """Each mistake once, at its first place, with all its lines: most are in <visual> and in <collision>."""
    found: dict[Finding, list[int]] = {}
    for each in findings:
        lines = found.setdefault(replace(each, line=0, also=()), [])
        lines += [line for line in (each.line, *each.also) if line not in lines]
    return [replace(each, line=lines[0], also=tuple(lines[1:])) for each, lines in found.items()]


def error(file: str, subject: str, message: str, remedy: str = "", line: int = 0) -> Finding:
    return Finding(Severity.ERROR, file, subject, message, remedy, line)


def note(file: str, subject: str, message: str, remedy: str = "", line: int = 0) -> Finding:
    return Finding(Severity.NOTE, file, subject, message, remedy, line)


def warning(file: str, subject: str, message: str, remedy: str = "", line: int = 0) -> Finding:
    return Finding(Severity.WARNING, file, subject, message, remedy, line)
