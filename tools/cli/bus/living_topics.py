"""Topics of nodes whose messages are not in `schemas`: read from what the living nodes say of themselves."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from gemelo.libraries.recordings.living_topic import living_topic
from gemelo.libraries.runtime.errors import NoAnswer, RequestRefused
from gemelo.libraries.runtime.started import load_started
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.system import Empty, TopicInterface
from gemelo.schemas.topics import TOPICS, Topic
from gemelo.tools.cli.bus.node import TIMEOUT, living
from gemelo.tools.cli.common.errors import unknown
from gemelo.tools.cli.common.session import CommandSession, connect

KNOWN = {topic.key: topic for topic in TOPICS}


def known_topic(name: str) -> Topic[Any] | None:
    """The topic of that key in our own table."""
    return KNOWN.get(name.strip("/"))


@contextmanager
def connected(name: str) -> Iterator[tuple[CommandSession, Topic[Any]]]:
    """Yields a session and the topic of that key; raises `CommandError` with the nearest key where there is none."""
    if known_topic(name) is None and not router_listens():  # nobody can say more than the table
        raise unknown("topic", name, list(KNOWN))
    with connect() as session:
        yield session, topic_on(session, name)


def all_topics() -> list[Topic[Any]]:
    """Those of our table and, where a router is there, those of its living nodes."""
    if not router_listens():
        return list(TOPICS)
    with connect() as session:
        return [*TOPICS, *other_topics(session)]


def router_listens() -> bool:
    """Loads nothing else, so that a table comes at once."""
    try:
        router = load_started().router
        socket.create_connection((router.host, router.port), timeout=1.0).close()
    except (OSError, ConfigurationError):
        return False
    return True


def topic_on(session: CommandSession, name: str) -> Topic[Any]:
    """The topic of that key, of our table or of a living node; raises `CommandError` with the nearest key."""
    known = known_topic(name)
    if known is not None:
        return known
    others = other_topics(session)
    for topic in others:
        if topic.key == name.strip("/"):
            return topic
    raise unknown("topic", name, [*KNOWN, *(topic.key for topic in others)])


def other_topics(session: CommandSession) -> list[Topic[Any]]:
    """The topics of all living nodes that our table does not have, by key."""
    found: dict[str, Topic[Any]] = {}
    for name in living(session):
        for each in _interfaces(session, name):
            if each.key not in KNOWN and not each.key.startswith("@"):
                found.setdefault(each.key, living_topic(each))
    return [found[key] for key in sorted(found)]


def _interfaces(session: CommandSession, name: str) -> tuple[TopicInterface, ...]:
    from gemelo.libraries.runtime.endpoints import interfaces_request  # slow to load: all that a node has on the bus

    try:
        return session.node.call(interfaces_request(name), Empty(), timeout=TIMEOUT).topics
    except (NoAnswer, RequestRefused):  # it has just ended, or is older
        return ()
