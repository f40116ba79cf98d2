"""Eyes on streamed targets: each path that the gateway is about to send is looked at in the scene as it is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.planning import StreamPath, StreamVerdict
from gemelo.schemas.topics import STREAM_PATHS, STREAM_VERDICTS
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.jog.jog_limits import worded
from gemelo.services.planner.jog.path_watch import PathWatch

MOST_ROWS = 500  # of a path; chosen: far beyond what one message to a device holds


class WatchService:
    """Answers in the node's thread of logic; what coal needs is made with the first path of each world."""

    def __init__(self, node: Node, arm: ArmDescription, newest: Callable[[], World]) -> None:
        """`newest` gives the world of the scene as it is."""
        self._node, self._arm, self._newest = node, arm, newest
        self._verdicts = node.publisher(STREAM_VERDICTS)
        self._world: World | None = None
        self._watch: PathWatch | None = None
        node.subscribe(STREAM_PATHS, self._on_path)

    def _on_path(self, path: StreamPath) -> None:
        count = len(self._arm.joints)
        if path.name != self._arm.joint_names or not 2 <= len(path.positions) <= MOST_ROWS:
            return
        if any(len(row) != count for row in path.positions):
            return
        newest = self._newest()
        if self._watch is None or newest is not self._world:
            self._watch, self._world = PathWatch(newest), newest
        limit = self._watch.in_the_way(np.array(path.positions), path.margin)
        limit = None if limit is None else worded(limit)
        stamp = self._node.now()
        self._verdicts.put(
            StreamVerdict(stamp=stamp, session=path.session, number=path.number, free=limit is None, limit=limit)
        )
