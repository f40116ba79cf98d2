"""The process: answers `plan` from the newest joint state, and shows the way it planned."""

from __future__ import annotations

import msgspec

from schemas.deployment import Deployment
from schemas.planning import PlanCode, PlanRequest, PlanResponse
from schemas.topics import FK, IK, JOINT_STATES, PLAN, PLAN_CANCEL, PLAN_PROGRESS, PLANNED_PATH
from services.arm.description import load_arm
from services.planner.core import Planner
from services.planner.goals.kinematic_requests import KinematicRequests
from services.planner.jog.jog_service import JogService
from services.planner.scene.scene_keeper import SceneKeeper
from services.planner.start import STALE_AFTER
from services.planner.workers.workers import Workers
from services.runtime.application import service
from services.runtime.deployment import project_root
from services.runtime.node import Node
from services.runtime.requests import Pending

PROGRESS_RATE = 10.0  # [Hz]
NOT_READY = "no fresh joint_states: is the stepper_gateway running?"


def run(node: Node, deployment: Deployment) -> None:
    """Serve until the node is stopped; ready while it knows where the arm is."""
    planner = Planner(load_arm(project_root() / deployment.robot))
    kinematic = KinematicRequests(planner.arm)
    states = node.latest(JOINT_STATES)
    path, progress = node.publisher(PLANNED_PATH), node.publisher(PLAN_PROGRESS)
    folder = project_root() / deployment.paths.run
    keeper = SceneKeeper(node, planner.arm, states, folder, planner.set_world)
    JogService(node, planner.arm, states, lambda: keeper.world)

    workers = Workers(
        planner.arm.folder, project_root(), lambda: (states.message, states.age()), lambda: keeper.world.scene
    )

    def plan(request: PlanRequest, pending: Pending[PlanResponse]) -> None:
        began = node.monotonic()
        workers.plan(request, lambda response: node.post(lambda: answer(response, pending, began)))

    def answer(response: PlanResponse, pending: Pending[PlanResponse], began: float) -> None:
        if response.code is PlanCode.SUCCESS:
            path.put(planner.planned_path(response.trajectory, node.now()))
        elif response.refusal is not None:
            node.log.info(f"refused: {response.refusal.message}")
        keeper.heed(response)
        pending.reply(msgspec.structs.replace(response, planning_time=node.monotonic() - began))

    def step(now: int) -> None:
        for each in workers.progress(now):
            progress.put(each)
        node.set_ready(states.age() < STALE_AFTER, "" if states.age() < STALE_AFTER else NOT_READY)

    node.serve_later(PLAN, plan)
    node.serve(PLAN_CANCEL, lambda request: workers.cancel(request.request_id))
    node.serve(
        IK,
        lambda request: kinematic.ik(request, states.message, states.age(), planner.surroundings.newest),
        worker=True,
    )
    node.serve(FK, lambda request: kinematic.fk(request, states.message, states.age()), worker=True)
    try:
        node.spin(step, rate=PROGRESS_RATE)
    finally:
        workers.close()


def main() -> None:
    """Console script `gemelo-planner`."""
    service("planner", run)


if __name__ == "__main__":
    main()
