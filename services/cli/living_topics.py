"""Topics of nodes whose messages are not in `schemas`: read from what the living nodes say of themselves."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from schemas.errors import ConfigurationError
from schemas.system import Empty, NodeStatistics, TopicInterface, TopicStatistics
from schemas.topics import STATISTICS, TOPICS, Topic
from services.cli.errors import unknown
from services.cli.node import TIMEOUT, information_of, living
from services.cli.session import Session, connect
from services.recordings.table import living_topic
from services.runtime.deployment import load_deployment
from services.runtime.endpoints import interfaces_request
from services.runtime.errors import NoAnswer, Refused

COUNTED_WITHIN = 1.3  # [s] every node tells its counters once a second
KNOWN = {topic.key: topic for topic in TOPICS}


def known_topic(name: str) -> Topic[Any] | None:
    """The topic of that key in our own table."""
    return KNOWN.get(name.strip("/"))


@contextmanager
def connected(name: str) -> Iterator[tuple[Session, Topic[Any]]]:
    """Yields a session and the topic of that key; raises `CommandError` with the nearest key where there is none."""
    if known_topic(name) is None and not _router_listens():  # nobody can say more than the table
        raise unknown("topic", name, list(KNOWN))
    with connect() as session:
        yield session, topic_on(session, name)


def all_topics() -> list[Topic[Any]]:
    """Those of our table and, where a router is there, those of its living nodes."""
    if not _router_listens():
        return list(TOPICS)
    with connect() as session:
        return [*TOPICS, *other_topics(session)]


def _router_listens() -> bool:
    """Loads nothing else, so that a table comes at once."""
    try:
        router = load_deployment().router
        socket.create_connection((router.host, router.port), timeout=1.0).close()
    except (OSError, ConfigurationError):
        return False
    return True


def ends(session: Session, key: str) -> dict[str, dict[str, str]]:
    """The living nodes that write the topic and those that read it, with what they have heard and lost."""
    counted: dict[str, NodeStatistics] = {}
    session.node.subscribe(STATISTICS, lambda message: counted.update({message.node: message}))
    session.node.wait(COUNTED_WITHIN)
    writers: dict[str, str] = {}
    readers: dict[str, str] = {}
    for name in living(session):
        info = information_of(session, name)
        if key in info.publishes:
            writers[name] = f"process {info.pid} on {info.host}"
        if key in info.subscribes:
            topics = counted[name].topics if name in counted else ()
            readers[name] = next((_counters(each) for each in topics if each.key == key), "not heard yet")
    return {"written_by": writers, "read_by": readers}


def _counters(each: TopicStatistics) -> str:
    return f"{each.received} received, {each.dropped} dropped, {each.bad} bad"


def topic_on(session: Session, name: str) -> Topic[Any]:
    """The topic of that key, of our table or of a living node; raises `CommandError` with the nearest key."""
    known = known_topic(name)
    if known is not None:
        return known
    others = other_topics(session)
    for topic in others:
        if topic.key == name.strip("/"):
            return topic
    raise unknown("topic", name, [*KNOWN, *(topic.key for topic in others)])


def other_topics(session: Session) -> list[Topic[Any]]:
    """The topics of all living nodes that our table does not have, by key."""
    found: dict[str, Topic[Any]] = {}
    for name in living(session):
        for each in _interfaces(session, name):
            if each.key not in KNOWN and not each.key.startswith("@"):
                found.setdefault(each.key, living_topic(each))
    return [found[key] for key in sorted(found)]


def _interfaces(session: Session, name: str) -> tuple[TopicInterface, ...]:
    try:
        return session.node.call(interfaces_request(name), Empty(), timeout=TIMEOUT).topics
    except (NoAnswer, Refused):  # it has just ended, or is older
        return ()
