"""The process: plans from the newest joint state in the present scene; answers `ik`, `fk`, `state_validity`; jogs."""

from __future__ import annotations

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.application import service
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.topics import JOINT_STATES
from gemelo.services.planner.core import Planner
from gemelo.services.planner.jog_service import JogService
from gemelo.services.planner.kinematic_service import KinematicService
from gemelo.services.planner.parameters import PlannerParameters
from gemelo.services.planner.pose_service import PoseService
from gemelo.services.planner.request.start_state import STALE_AFTER
from gemelo.services.planner.scene.answer_log import AnswerLog
from gemelo.services.planner.scene.scene_keeper import SceneKeeper
from gemelo.services.planner.watch_service import WatchService
from gemelo.services.planner.workers.in_process import PlansInProcess
from gemelo.services.planner.workers.plan_service import PlanMaker, PlanService
from gemelo.services.planner.workers.workers import Present, Workers

# Tuning constants: chosen, where a line does not say measured or standard.
RATE = 10.0  # [Hz] at which it says how plans stand; chosen: smooth for a person's eye
STARTING = because("ready.planner.starting")
NOT_READY = because("ready.no_states", remedy("see_gateway"))


def run(node: Node, deployment: Deployment) -> None:
    """Serve until the node is stopped; ready while it knows where the arm is, and can plan."""
    arm = load_arm(project_root() / deployment.robot)
    planner, parameters = Planner(arm), node.parameters(PlannerParameters)
    states, log = node.latest(JOINT_STATES), AnswerLog(node, lambda: parameters.value.record_inputs)
    keeper = SceneKeeper(node, arm, states, project_root() / deployment.paths.run, planner.set_world, log)
    JogService(node, arm, states, lambda: keeper.world, lambda: parameters.value.record_inputs)
    PoseService(node, arm, states)
    WatchService(node, arm, lambda: keeper.world)
    KinematicService(node, arm, states, lambda: planner.checker.newest, log)
    present: Present = lambda: (states.message, states.age())  # noqa: E731
    workers: PlanMaker
    if node.clock.is_virtual:
        workers = PlansInProcess(node.clock, planner, present, lambda: keeper.world.scene)
    else:
        workers = Workers(arm.folder, project_root(), present, lambda: keeper.world.scene)
    plans = PlanService(node, workers, planner, keeper, lambda: parameters.value.record_inputs)

    def step(now: int) -> None:
        plans.step(now)
        why = NOT_READY if states.age() >= STALE_AFTER else None if workers.are_ready else STARTING
        node.set_ready(why is None, why or "")

    node.at_end(workers.close)
    node.spin(step, rate=RATE)


def main() -> None:
    """Console script `gemelo-planner`."""
    service("planner", run)


if __name__ == "__main__":
    main()
