"""The black box: the last minute in memory, and on any incident that minute with its story as a file of its own."""

from __future__ import annotations

import threading
from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.incidents import (
    BLACK_BOX,
    Incident,
    IncidentKind,
    incident_in,
    incident_metadata,
    saving_mark,
)
from gemelo.libraries.recordings.mcap_file import McapFile
from gemelo.libraries.recordings.reader import BadRecording, RecordingReader
from gemelo.libraries.recordings.view_layout import layout_metadata, layout_of
from gemelo.libraries.runtime.bus.wire import MAX_PAYLOAD_OF
from gemelo.libraries.runtime.process.own_files import own_folder
from gemelo.schemas.message import Message, encode
from gemelo.schemas.scene import PlanningScene
from gemelo.schemas.topics import Delivery, Topic
from gemelo.services.logger.core import is_past_mesh
from gemelo.services.logger.files import MCAP, prune, stem_of
from gemelo.services.logger.incident_story import incident_of
from gemelo.services.logger.incident_watch import IncidentWatch, Trigger

SECOND = 1_000_000_000  # [ns]
AFTERWARDS = 3 * SECOND  # [ns] that are waited for what follows an incident
APART = 10 * SECOND  # [ns] between two files at least: what happens in between is in the second one
TOGETHER = SECOND  # [ns] in which the gateway says what happened after it has aborted the goal for it
MOST_BYTES = 64_000_000  # of messages that may be large; chosen: two plans of the most points, or a hundred usual ones
MOST = 100_000  # messages: 60 s of an arm in motion are some 30,000


@dataclass
class BlackBox:
    """The messages of the last `seconds`, and the incident that is waited out. Pure."""

    seconds: float = 60.0
    _watch: IncidentWatch = field(default_factory=IncidentWatch, init=False)
    _entries: deque[Entry] = field(default_factory=lambda: deque(maxlen=MOST), init=False)
    _sizes: deque[int] = field(default_factory=deque, init=False)  # [bytes] of each, 0 of what cannot be large
    _size: int = field(default=0, init=False)  # [bytes] of all
    _latched: dict[tuple[str, str], Entry] = field(default_factory=dict, init=False)  # that have left `_entries`
    _pending: Trigger | None = field(default=None, init=False)
    _due: int = field(default=0, init=False)  # [ns] when the pending one is told
    _told: int = field(default=-APART, init=False)  # [ns] when the last one was

    def on_message(self, topic: Topic[Any], message: Message, now: int) -> None:
        """Keeps one message that came at `now` [ns] UNIX."""
        size = _size_of(message)
        while self._entries and (len(self._entries) == MOST or (size and self._size + size > MOST_BYTES)):
            self._forget_oldest()
        self._entries.append(Entry(topic, message, now))
        self._sizes.append(size)
        self._size += size
        self._take(self._watch.on_message(topic, message, now))

    @property
    def is_pending(self) -> bool:
        """True from an incident until `step` or `finish` returns it."""
        return self._pending is not None

    def step(self, now: int, router: str = "") -> tuple[Incident, tuple[Entry, ...]] | None:
        """An incident that is to be saved now, with its messages; `now` in [ns] UNIX, with the `router` of now."""
        horizon = now - int(self.seconds * SECOND)
        while self._entries and self._entries[0].arrival < horizon:
            self._forget_oldest()
        self._take(self._watch.on_router(router, now))
        self._take(self._watch.step(now))
        return self._tell(now) if self._pending is not None and now >= self._due else None

    def finish(self, now: int) -> tuple[Incident, tuple[Entry, ...]] | None:
        """The incident that nobody waits for any more."""
        return self._tell(now) if self._pending is not None else None

    def _take(self, trigger: Trigger | None) -> None:
        """What follows an incident is of its story, and no other one; an abort that comes before its cause is that."""
        if trigger is None:
            return
        pending = self._pending
        if pending is None:
            self._pending = trigger
            self._due = max(trigger.stamp + AFTERWARDS, self._told + APART)
        elif pending.kind is IncidentKind.ABORT and trigger.stamp - pending.stamp < TOGETHER:
            self._pending = replace(trigger, stamp=pending.stamp)

    def _tell(self, now: int) -> tuple[Incident, tuple[Entry, ...]]:
        assert self._pending is not None
        entries = (*self._latched.values(), *self._entries)
        incident = incident_of(self._pending, entries)
        self._pending, self._told = None, now
        return incident, entries

    def _forget_oldest(self) -> None:
        entry = self._entries.popleft()
        self._size -= self._sizes.popleft()
        if entry.topic.delivery is Delivery.LATCHED:
            self._latched[entry.topic.key, getattr(entry.message, "node", "")] = entry
        if isinstance(entry.message, PlanningScene):  # from here on it is the oldest scene of the minute
            scene = entry.message
            self._latched = {key: each for key, each in self._latched.items() if not is_past_mesh(key[0], scene)}


def _size_of(message: Message) -> int:
    """[bytes] of a message of a kind that may be large, 0 of any other."""
    return len(encode(message)) if type(message).__name__ in MAX_PAYLOAD_OF else 0


class BlackBoxWriter:
    """Writes black boxes beside the logger's own work; `tell` says where one is, or why it is not."""

    def __init__(
        self,
        robot: str,
        metadata: dict[str, dict[str, str]],
        tell: Callable[[str], None],
        cameras: tuple[str, ...] = (),
    ) -> None:
        """`metadata` by the name of its record; `cameras` have a view each."""
        self._robot, self._metadata, self._tell, self._cameras = robot, metadata, tell, cameras
        self._thread: threading.Thread | None = None

    def save(self, incident: Incident, entries: tuple[Entry, ...], folder: Path, keep: int) -> None:
        """Begins to write a file in `folder`, which keeps the newest `keep` of each kind; one is written at a time."""
        self.wait()
        self._thread = threading.Thread(
            target=self._save, args=(incident, entries, folder, keep), name="black box", daemon=True
        )
        self._thread.start()

    @property
    def is_writing(self) -> bool:
        return self._thread is not None and self._thread.is_alive()

    def wait(self, timeout: float | None = None) -> None:
        """Until the file is written, `timeout` [s] at most."""
        if self._thread is not None:
            self._thread.join(timeout)

    def _save(self, incident: Incident, entries: tuple[Entry, ...], folder: Path, keep: int) -> None:
        metadata = {**self._metadata, **layout_metadata(layout_of(entries, self._cameras))}
        try:
            path = write_black_box(folder, self._robot, metadata, incident, entries)
            prune_each_kind(folder, self._robot, keep, (path.stem,))
        except OSError as error:
            self._tell(f"{BLACK_BOX}{incident.sentence}; it cannot be written to {folder}: {error.strerror or error}")
        else:
            self._tell(f"{BLACK_BOX}{incident.sentence}; `gemelo blackbox open`, or {path}")


class SavingMark:
    """The file by which others see that a black box is being saved; a disk that takes none has no mark."""

    def __init__(self, folder: Path, robot: str) -> None:
        self._folder, self._file, self._is_set = folder, saving_mark(folder, robot), False

    def show(self, is_saving: bool) -> None:
        """Makes or removes the file where that has changed."""
        if is_saving == self._is_set:
            return
        self._is_set = is_saving
        with suppress(OSError):
            if is_saving:
                own_folder(self._folder)
                self._file.touch()
            else:
                self._file.unlink(missing_ok=True)


def prune_each_kind(folder: Path, robot: str, keep: int, ours: Sequence[str]) -> None:
    """As `prune`, for the incidents of each kind: many of one, whoever causes them, push out none of another.

    What cannot be read is of a kind of its own.
    """
    names: dict[str, list[str]] = defaultdict(list)
    for path in folder.glob(f"*{MCAP}"):
        try:
            incident = incident_in(RecordingReader(path))
        except BadRecording:
            incident = None
        names[incident.kind if incident is not None else ""].append(path.name)
    for of_a_kind in names.values():
        prune(folder, robot, keep, [stem for stem in ours if f"{stem}{MCAP}" in of_a_kind], of_a_kind)


def write_black_box(
    folder: Path, robot: str, metadata: dict[str, dict[str, str]], incident: Incident, entries: tuple[Entry, ...]
) -> Path:
    """Writes the file; raises OSError."""
    own_folder(folder)
    path = folder / (stem_of(robot, incident.stamp) + MCAP)
    file = McapFile(path, {**metadata, **incident_metadata(incident)})
    try:
        file.write(entries)
        file.close()
    except OSError:
        file.abandon()
        path.unlink(missing_ok=True)
        raise
    return path
