"""A virtual arm whose streamed targets a planner's eyes watch, in virtual time."""

from __future__ import annotations

import time
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.frames import Transform
from gemelo.schemas.message import Vector
from gemelo.schemas.planning import StreamVerdict
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject
from gemelo.schemas.topics import STREAM_PATHS
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.jog.path_watch import PathWatch
from gemelo.tools.virtual_arm.gateway_driver import VerdictInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm

Array = NDArray[np.float64]


def world_with(arm: ArmDescription, *boxes: tuple[Vector, Vector]) -> World:
    """The arm among boxes of a size (3,) at a place (3,) [m]."""
    objects = tuple(
        SceneObject(name=f"box_{index}", shape=BoxShape(size=size), pose=Transform(translation=place))
        for index, (size, place) in enumerate(boxes)
    )
    return World(arm, Kinematics(arm), PlanningScene(objects=objects))


class WatchedArm(VirtualArm):
    """Each path is answered `takes` [s] after it was published; never while that is None."""

    watches = True

    def __init__(self, *given: Any, world: World | None = None, takes: float | None = 0.004, **named: Any) -> None:
        self.takes, self._seen = takes, 0
        self.looks: list[float] = []  # [s] of CPU time that each has taken
        self._due: deque[tuple[float, StreamVerdict]] = deque()
        super().__init__(*given, **named)
        self.world = world or world_with(self.arm)
        self.watch = PathWatch(self.world)

    def _step(self, until_us: int) -> None:
        super()._step(until_us)
        paths = self.messages(STREAM_PATHS)
        while self._seen < len(paths):
            path = paths[self._seen]
            self._seen += 1
            if self.takes is not None:
                began = time.thread_time()
                limit = self.watch.in_the_way(np.array(path.positions), path.margin)
                self.looks.append(time.thread_time() - began)
                verdict = StreamVerdict(session=path.session, number=path.number, free=limit is None, limit=limit)
                self._due.append((self.now + self.takes, verdict))
        while self._due and self._due[0][0] <= self.now:
            self.handle(VerdictInput(self._due.popleft()[1]))

    def nearest(self, every: int = 10) -> float:
        """[m] between the arm and the nearest thing on the path that was executed, looked at each `every` [ms]."""
        scales = np.array([joint.steps.per_unit for joint in self.arm.joints])
        rows = {tuple(np.round(np.array(row) / scales, 5)) for row in self.path[::every]}
        return min(self.world.distance(np.array(row)) for row in rows)
