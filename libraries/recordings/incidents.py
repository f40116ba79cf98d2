"""Incidents as a black box keeps them: a sentence, the events before and after; and the folder of black boxes.

Beside each English sentence is its reason, from which `in_language` makes it in another language.
"""

from __future__ import annotations

from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path

import msgspec
from msgspec.structs import replace

from gemelo.libraries.recordings.reader import BadRecording, RecordingReader
from gemelo.schemas.reasons import Reason, because, say

INCIDENT = "incident"  # the name of the metadata record
BLACK_BOX = "black box: "  # the logger's line about a new one begins with it
FOLDER = "blackbox"  # in the folder of what runs leave
LONGEST = 160  # letters of a line of the story, and of a margin


SAVING_AT_MOST = 60.0  # [s] from an incident to its file; a mark that is older is that of a logger that was killed


class IncidentKind(StrEnum):
    """What a black box is saved for."""

    EMERGENCY_STOP = "emergency stop"
    FAULT = "fault"
    REBOOT = "reboot"
    ABORT = "abort"
    LOST = "service lost"  # it has ended, hangs, or its host is cut off


class Happening(msgspec.Struct, frozen=True, kw_only=True):
    """One line of the story; `at` [s] counts from the incident, before it negative."""

    at: float
    text: str
    why: Reason | None = None  # `text` as data


class Incident(msgspec.Struct, frozen=True, kw_only=True):
    """The moment, and its story."""

    stamp: int  # [ns] UNIX
    kind: IncidentKind
    sentence: str  # what happened, when, and in what
    margins: tuple[str, ...] = ()  # the joints and their margins at that moment, a sentence each
    story: tuple[Happening, ...] = ()  # in the order of time
    why: Reason | None = None  # `sentence` as data: its cause is what happened, without the time
    margins_why: tuple[Reason, ...] = ()  # `margins` as data


class BlackBoxFile(msgspec.Struct, frozen=True, kw_only=True):
    """One saved black box."""

    path: str
    incident: Incident


def saving_mark(folder: Path, robot: str) -> Path:
    """The file that is there from an incident until its black box is written."""
    return folder / f".{robot}.saving"


def is_saving(folder: Path, robot: str, now: float) -> bool:
    """True if a black box of the robot is being saved; `now` [s] UNIX."""
    try:
        return now - saving_mark(folder, robot).stat().st_mtime < SAVING_AT_MOST
    except OSError:
        return False


def incident_metadata(incident: Incident) -> dict[str, dict[str, str]]:
    """The record of a recording's metadata."""
    return {INCIDENT: {"json": msgspec.json.encode(incident).decode()}}


def read_incident(path: Path) -> Incident:
    """What a black box tells of itself; raises `BadRecording` where the file is none."""
    incident = incident_in(RecordingReader(path))
    if incident is None:
        raise BadRecording(because("recording.no_black_box", file=str(path)))
    return incident


def incident_in(reader: RecordingReader) -> Incident | None:
    """The incident of a recording, if it is a black box; raises `BadRecording` where it cannot be read."""
    return reader.read_record(INCIDENT, Incident)


def black_boxes(folder: Path, robot: str) -> list[BlackBoxFile]:
    """Those of a robot in `folder`, the newest first; what cannot be read is left out."""
    found = []
    for path in sorted(folder.glob(f"*_{robot}.mcap"), reverse=True):
        try:
            found.append(BlackBoxFile(path=str(path), incident=read_incident(path)))
        except BadRecording:
            continue
    return found


def in_language(incident: Incident, language: str) -> Incident:
    """With its sentences in that language; those of a file without reasons stay as they are."""
    if incident.why is None:
        return incident
    return replace(
        incident,
        sentence=say(incident.why, language),
        margins=tuple(one_line(say(each, language)) for each in incident.margins_why),
        story=tuple(
            each if each.why is None else replace(each, text=one_line(say(each.why, language)))
            for each in incident.story
        ),
    )


def one_line(text: str, longest: int = LONGEST) -> str:
    """Without line breaks, and cut to `longest` letters."""
    line = " ".join(text.split())
    return line if len(line) <= longest else line[: longest - 4] + " ..."


def time_of(stamp: int) -> str:
    """UTC to the millisecond, of ns UNIX."""
    seconds, nanoseconds = divmod(stamp, 1_000_000_000)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S}.{nanoseconds // 1_000_000:03d} UTC"
