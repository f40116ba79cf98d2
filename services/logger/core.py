"""The logger without its files: messages to be written, and losses. Pure."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field
from typing import Any

from gemelo.libraries.recordings.channels import Entry
from gemelo.schemas.device import CommandAck, CommandChunk
from gemelo.schemas.message import Message
from gemelo.schemas.scene import PlanningScene
from gemelo.schemas.scene_meshes import digests_in
from gemelo.schemas.topics import Delivery, Topic, scene_mesh
from gemelo.services.logger.command_log import CommandLog, CommandRow

MAX_WAITING = 10_000  # messages held while the disk refuses: about half a minute of full motion


@dataclass(frozen=True)
class Batch:
    """The entries and rows to be written now."""

    entries: tuple[Entry, ...] = ()
    lines: tuple[CommandRow, ...] = ()


@dataclass(frozen=True)
class Losses:
    """The messages that are missing from the files."""

    dropped: dict[str, int] = field(default_factory=dict)  # by key: the disk refused for too long
    missing_chunks: int = 0  # gaps in the sequence of commands
    lost_chunks: int = 0  # commands that the device never answered
    malformed_chunks: int = 0  # commands whose tables do not fit together

    @property
    def sentence(self) -> str:
        """For a person; empty where nothing is missing."""
        dropped = ", ".join(f"{count} of `{key}`" for key, count in sorted(self.dropped.items()))
        parts = [f"messages not written: {dropped}"] if dropped else []
        parts += [f"{self.missing_chunks} command chunks never arrived at the logger"] if self.missing_chunks else []
        parts += [f"{self.lost_chunks} command chunks were never acknowledged"] if self.lost_chunks else []
        parts += (
            [f"{self.malformed_chunks} malformed command chunks are not in the CSV"] if self.malformed_chunks else []
        )
        return "; ".join(parts)


def is_past_mesh(key: str, scene: PlanningScene) -> bool:
    """True for the key of a mesh's file that `scene` does not name."""
    digest = key.rpartition("/")[2]
    return key == scene_mesh(digest).key and digest not in digests_in(scene)


class Logger:
    """Collects messages between two writes, and keeps those that every file begins with."""

    def __init__(self, max_waiting: int = MAX_WAITING) -> None:
        self.commands = CommandLog()
        self._waiting: deque[Entry] = deque()
        self._lines: deque[CommandRow] = deque()
        self._max_waiting = max_waiting
        self._latched: dict[tuple[str, str], Entry] = {}  # by key, and by node where each says one of its own
        self._dropped: Counter[str] = Counter()

    def on_message(self, topic: Topic[Any], message: Message, now: int) -> None:
        """Take one message that arrived at `now` [ns] UNIX."""
        entry = Entry(topic, message, now)
        self._keep(entry)
        if topic.delivery is Delivery.LATCHED:
            self._latched[topic.key, getattr(message, "node", "")] = entry
        match message:
            case PlanningScene():
                self._latched = {key: each for key, each in self._latched.items() if not is_past_mesh(key[0], message)}
            case CommandChunk():
                self.commands.on_chunk(message, now)
            case CommandAck():
                self.commands.on_ack(message)

    def step(self, now: int) -> Batch:
        """Everything that waits; what could not be written comes back by `give_back`."""
        self._lines.extend(self.commands.step(now))
        return self._take()

    def finish(self, now: int) -> Batch:
        """Everything that is left when the logger stops."""
        self._lines.extend(self.commands.finish(now))
        return self._take()

    def give_back(self, batch: Batch) -> None:
        """Keep for later what the disk refused; the least valuable of too much is dropped and counted."""
        self._lines.extendleft(reversed(batch.lines))
        while len(self._lines) > self._max_waiting:
            self._lines.popleft()
            self._dropped["commands.csv"] += 1
        self._waiting.extendleft(reversed(batch.entries))
        self._drop_excess()

    def first_entries(self, batch: Batch, now: int) -> tuple[Entry, ...]:
        """The latched messages that a file begins with so that it can be read alone; `batch` brings its own."""
        said = [entry for entry in self._latched.values() if entry not in batch.entries]
        return tuple(Entry(entry.topic, entry.message, now) for entry in said)

    @property
    def losses(self) -> Losses:
        """The losses so far."""
        return Losses(dict(self._dropped), self.commands.missing, self.commands.lost, self.commands.malformed)

    def _keep(self, entry: Entry) -> None:
        self._waiting.append(entry)
        if len(self._waiting) > self._max_waiting:
            self._drop_excess()

    def _drop_excess(self) -> None:
        """States go first, a tenth at a time; commands, faults and logs only where nothing else is left."""
        while len(self._waiting) > self._max_waiting:
            quota = len(self._waiting) - self._max_waiting + self._max_waiting // 10
            kept: deque[Entry] = deque()
            for entry in self._waiting:
                if quota and entry.topic.delivery is Delivery.LATEST:
                    quota -= 1
                    self._dropped[entry.topic.key] += 1
                else:
                    kept.append(entry)
            while len(kept) > self._max_waiting:
                self._dropped[kept.popleft().topic.key] += 1
            self._waiting = kept

    def _take(self) -> Batch:
        batch = Batch(tuple(self._waiting), tuple(self._lines))
        self._waiting.clear()
        self._lines.clear()
        return batch
