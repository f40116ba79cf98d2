"""The process: answers `plan` from the newest joint state, and shows the way it planned."""

from __future__ import annotations

import msgspec

from schemas.deployment import Deployment
from schemas.planning import PlanCode, PlanRequest, PlanResponse
from schemas.topics import FK, IK, JOINT_STATES, PLAN, PLANNED_PATH
from services.arm.description import load_arm
from services.planner.core import Planner
from services.planner.kinematic_requests import KinematicRequests
from services.planner.scene_keeper import SceneKeeper
from services.planner.start import STALE_AFTER
from services.runtime.application import service
from services.runtime.deployment import project_root
from services.runtime.node import Node

NOT_READY = "no fresh joint_states: is the stepper_gateway running?"


def run(node: Node, deployment: Deployment) -> None:
    """Serve until the node is stopped; ready while it knows where the arm is."""
    planner = Planner(load_arm(project_root() / deployment.robot))
    kinematic = KinematicRequests(planner.arm)
    states = node.latest(JOINT_STATES)
    path = node.publisher(PLANNED_PATH)
    folder = project_root() / deployment.paths.run
    keeper = SceneKeeper(node, planner.arm, states, folder, planner.set_world)

    def plan(request: PlanRequest) -> PlanResponse:
        began = node.monotonic()
        response = planner.plan(
            request,
            states.message,
            states.age(),
            clock=node.monotonic,
        )
        took = node.monotonic() - began
        if response.code is PlanCode.SUCCESS:
            path.put(planner.planned_path(response.trajectory, node.now()))
        elif response.refusal is not None:
            node.log.info(f"refused: {response.refusal.message}")
        keeper.heed(response)
        return msgspec.structs.replace(response, planning_time=took)

    def step(_now: int) -> None:
        node.set_ready(states.age() < STALE_AFTER, "" if states.age() < STALE_AFTER else NOT_READY)

    # In the worker: a plan may take its whole allowed_time, and readiness keeps beating meanwhile.
    node.serve(PLAN, plan, worker=True)
    node.serve(
        IK,
        lambda request: kinematic.ik(request, states.message, states.age(), planner.surroundings.newest),
        worker=True,
    )
    node.serve(FK, lambda request: kinematic.fk(request, states.message, states.age()), worker=True)
    node.spin(step, rate=10.0)


def main() -> None:
    """Console script `gemelo-planner`."""
    service("planner", run)


if __name__ == "__main__":
    main()
