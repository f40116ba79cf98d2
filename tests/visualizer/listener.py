"""Messages of a sink to a viewer, kept for inspection."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import rerun.blueprint as rrb


class Listener:
    """A recording stream that keeps what it is told."""

    def __init__(self) -> None:
        self.said: dict[str, list[Any]] = {}
        self.sent: list[tuple[str, list[int]]] = []

    def log(self, entity: str, *things: Any, static: bool = False) -> None:
        self.said.setdefault(entity, []).extend(things)

    def send_columns(self, entity: str, index: list[Any], columns: Any) -> None:
        self.sent += [(entity, column.as_arrow_array().values.to_pylist()) for column in columns]

    def send_blueprint(self, layout: rrb.Blueprint) -> None:
        self.layout = layout


def views(node: Any) -> Iterator[Any]:
    """All views in a container, wherever in it."""
    if isinstance(node, rrb.Container):
        for inner in node.contents:
            yield from views(inner)
    else:
        yield node
