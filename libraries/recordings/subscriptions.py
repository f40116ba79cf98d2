"""The subscriptions of a recording: all known topics at once, and those of users' nodes as they appear."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from gemelo.libraries.recordings.census import Census
from gemelo.libraries.recordings.table import NODES, recorded_topics, topics_of_node
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.scene_meshes import SceneMeshes
from gemelo.libraries.runtime.topics import Subscription
from gemelo.schemas.message import Message
from gemelo.schemas.system import NodeRecord
from gemelo.schemas.topics import SCENE, Topic

MAX_OTHERS = 512  # topics besides those of the table: what a node tells of itself is not to be trusted for more
ALL = 0.0  # [s] of a LATEST topic too no message is left out while a file is written

OnMessage = Callable[[Topic[Any], Message], None]


class Subscriptions:
    """Hands every message that is recorded to `on_message`, in the thread of logic."""

    def __init__(self, node: Node, on_message: OnMessage, is_chosen: Callable[[str], bool] = lambda key: True) -> None:
        """`is_chosen(key)` says which topics."""
        self._node, self._on_message, self._is_chosen = node, on_message, is_chosen
        self._others: dict[str, tuple[Topic[Any], Subscription[Any]]] = {}
        self._is_full = False
        for topic in recorded_topics():
            if topic is not NODES and is_chosen(topic.key):
                self._subscribe(topic)
        if is_chosen(SCENE.key):
            node.subscribe(SCENE, SceneMeshes(node, lambda scene: None, on_message).on_scene, batch=ALL)
        Census(node, self._on_record)

    @property
    def others(self) -> tuple[str, ...]:
        """The keys of users' topics that were found."""
        return tuple(self._others)

    def _subscribe(self, topic: Topic[Any]) -> Subscription[Any]:
        return self._node.subscribe(topic, lambda message: self._on_message(topic, message), own=True, batch=ALL)

    def _on_record(self, record: NodeRecord) -> None:
        if self._is_chosen(NODES.key):
            self._on_message(NODES, record)
        for topic in topics_of_node(record):
            if self._is_chosen(topic.key):
                self._add(topic)

    def _add(self, topic: Topic[Any]) -> None:
        """Subscribes, once; anew where the topic carries another message than before."""
        known = self._others.get(topic.key)
        if known is not None:
            if _is_same(known[0], topic):
                return
            known[1].close()
        elif len(self._others) >= MAX_OTHERS:
            if not self._is_full:
                self._is_full = True
                self._node.log.warning("%s and further topics are not recorded: %d are", topic.key, MAX_OTHERS)
            return
        self._others[topic.key] = (topic, self._subscribe(topic))


def _is_same(first: Topic[Any], second: Topic[Any]) -> bool:
    """True if both carry a message of one name and fields, in the same way."""
    names = [each.message.__struct_fields__ for each in (first, second)]
    kinds = [each.message.__name__ for each in (first, second)]
    return names[0] == names[1] and kinds[0] == kinds[1] and replace(first, message=second.message) == second
