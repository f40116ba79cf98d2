"""The findings of a check of a robot's folder."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Severity(StrEnum):
    """An error must be corrected before the arm moves; a warning is reported only."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong: a sentence with the thing and its value, and the remedy."""

    severity: Severity
    file: str
    thing: str  # for example: joint "brazo_joint"
    message: str
    remedy: str = ""

    def __str__(self) -> str:
        remedy = f" -> {self.remedy}" if self.remedy else ""
        return f"{self.severity}: {self.file}: {self.thing}: {self.message}{remedy}"


def error(file: str, thing: str, message: str, remedy: str = "") -> Finding:
    return Finding(Severity.ERROR, file, thing, message, remedy)


def warning(file: str, thing: str, message: str, remedy: str = "") -> Finding:
    return Finding(Severity.WARNING, file, thing, message, remedy)
