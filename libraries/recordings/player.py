"""A recording that is played back on the bus, as the nodes that were recorded, under the name of a shadow robot.

The player takes the names of the nodes whose messages it plays. A name belongs to one living process, so no robot that
runs can be played over, and none can start under the shadow's name while it plays.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import msgspec

from gemelo.libraries.recordings.reader import RecordingReader, Row
from gemelo.libraries.recordings.table import NODES, recorded_topics
from gemelo.libraries.runtime.bus import identity
from gemelo.libraries.runtime.bus.branches import NAME, is_of_many
from gemelo.libraries.runtime.bus.interface import Bus, Publication
from gemelo.schemas.message import Message, encode
from gemelo.schemas.scene import SceneMesh
from gemelo.schemas.topics import ANY, Delivery

NODE = "player"
NOT_PLAYED = {NODES.key}  # what the logger itself has written


class OfNode(msgspec.Struct):
    """What a message of a key of every node says of its writer."""

    node: str = ""


@dataclass
class Played:
    """One message that is due at `at` [s] after the first of the recording."""

    at: float
    row: Row


class Roles:
    """The right to speak as the nodes that were recorded."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._publications: dict[tuple[str, str, str], Publication] = {}
        self._claimed: dict[str, str] = {}  # by name, the instance that this player is of it

    def claim(self, writers: set[str]) -> None:
        """Takes the names; raises `NodeNameTaken` where a living node has one of them."""
        for name in sorted(writers - self._claimed.keys()):
            role = identity.identify(name, self._bus.common_name)
            identity.claim(self._bus, role)
            self._claimed[name] = role.instance

    def put(self, row: Row) -> None:
        """Publishes one message as it was said."""
        key, schema = row.channel.topic, row.schema.name
        writer = writer_of(row)
        publication = self._publications.get((key, schema, writer))
        if publication is None:
            instance = self._claimed.get(writer, "") if delivery_of(row) is Delivery.LATCHED else ""
            publication = self._bus.publish(key, schema, delivery_of(row), writer, instance)
            self._publications[key, schema, writer] = publication
        publication.put(payload_of(row))


def writer_of(row: Row) -> str:
    """The node that has written it: of a key of every node as the message says, of one of many the player."""
    if is_of_many(row.channel.topic):
        said = msgspec.json.decode(row.message.data, type=OfNode).node
        return said if NAME.fullmatch(said) else NODE
    writer = row.channel.metadata.get("writer", "")
    return NODE if writer == ANY else writer


def delivery_of(row: Row) -> Delivery:
    """As its writer had it; EVERY where the file does not say."""
    said = row.channel.metadata.get("delivery", "")
    return Delivery(said) if said in {each.value for each in Delivery} else Delivery.EVERY


_kinds: dict[tuple[str, str], type[Message]] = {}


def payload_of(row: Row) -> bytes:
    """The message as it travels; raises msgspec's errors where the recording has another one under this name."""
    if not _kinds:
        _kinds.update({(topic.key, topic.message.__name__): topic.message for topic in recorded_topics()})
    kind = SceneMesh if row.schema.name == SceneMesh.__name__ else _kinds.get((row.channel.topic, row.schema.name))
    if kind is None:
        return msgspec.msgpack.encode(msgspec.json.decode(row.message.data))
    return encode(msgspec.json.decode(row.message.data, type=kind))


@dataclass
class Player:
    """When each message is due: at `rate` times real time, in steps, again from the start; pure but for the file."""

    reader: RecordingReader
    is_chosen: Callable[[str], bool] = lambda topic: True
    rate: float = 1.0
    start: float = 0.0  # [s] after the first message
    loop: bool = False
    is_paused: bool = False
    position: float = 0.0  # [s] after the first message
    played: int = 0
    _waiting: Played | None = field(default=None, init=False)
    _messages: Iterator[Played] = field(default_factory=lambda: iter(()), init=False)
    _first: int = field(default=0, init=False)  # [ns] UNIX arrival of the first message

    def __post_init__(self) -> None:
        self.rewind()

    @property
    def writers(self) -> set[str]:
        """The nodes whose messages are played; reads the file once."""
        rows = self.reader.rows(self.is_chosen)
        said = {row.channel.metadata.get("writer", "") for row in rows if _is_played(row)}
        return {name for name in said if name and name != ANY and NAME.fullmatch(name)}

    @property
    def is_over(self) -> bool:
        return self._waiting is None

    def rewind(self) -> None:
        """From the start again."""
        self._first, self.position = 0, self.start
        self._messages = self._read()
        self._advance()

    def due(self, elapsed: float) -> Iterator[Row]:
        """What is to be said after `elapsed` [s] more of real time; nothing while paused."""
        if not self.is_paused:
            self.position += elapsed * self.rate
            yield from self._until(self.position)
            if self.is_over and self.loop and self.played:
                self.rewind()

    def step(self) -> Iterator[Row]:
        """The next message and those of the same instant."""
        if self._waiting is not None:
            self.position = max(self.position, self._waiting.at)
            yield from self._until(self.position)

    def _until(self, position: float) -> Iterator[Row]:
        while self._waiting is not None and self._waiting.at <= position:
            row = self._waiting.row
            self._advance()
            self.played += 1
            yield row

    def _advance(self) -> None:
        self._waiting = next(self._messages, None)

    def _read(self) -> Iterator[Played]:
        """In the order of the file; what is latched before the start comes with the start."""
        latched: dict[str, Row] = {}
        for row in self.reader.rows(self.is_chosen):
            if not _is_played(row):
                continue
            self._first = self._first or row.message.log_time
            at = (row.message.log_time - self._first) / 1e9
            if at >= self.start:
                yield from (Played(self.start, each) for each in latched.values())
                latched = {}
                yield Played(at, row)
            elif delivery_of(row) is Delivery.LATCHED:
                latched[row.channel.topic] = row


def _is_played(row: Row) -> bool:
    return not row.is_derived and row.channel.topic not in NOT_PLAYED
