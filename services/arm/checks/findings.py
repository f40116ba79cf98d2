"""The findings of a check of a robot's folder."""

from __future__ import annotations

from dataclasses import dataclass
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

    def __str__(self) -> str:
        remedy = f" -> {self.remedy}" if self.remedy else ""
        line = f", line {self.line}" if self.line else ""
        return f"{self.severity}: {self.file}{line}: {self.subject}: {self.message}{remedy}"


def error(file: str, subject: str, message: str, remedy: str = "", line: int = 0) -> Finding:
    return Finding(Severity.ERROR, file, subject, message, remedy, line)


def note(file: str, subject: str, message: str, remedy: str = "", line: int = 0) -> Finding:
    return Finding(Severity.NOTE, file, subject, message, remedy, line)


def warning(file: str, subject: str, message: str, remedy: str = "", line: int = 0) -> Finding:
    return Finding(Severity.WARNING, file, subject, message, remedy, line)
