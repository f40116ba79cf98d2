"""A node in place of our planner: `gemelo move --joints` goes straight there, slowly, and heeds nothing on the way."""

from gemelo import Node, topics
from gemelo.schemas.motion import JointTrajectory, TrajectoryPoint
from gemelo.schemas.planning import JointGoal, PlanCode, PlanRequest, PlanResponse, Refusal

SECONDS = 10.0  # for every move

with Node("planner") as node:
    joints = node.latest(topics.JOINT_STATES)

    def plan(request: PlanRequest) -> PlanResponse:
        if not isinstance(request.goal, JointGoal) or joints.message is None:
            said = Refusal(check="goal", message="this planner needs joint states, and takes joint values alone")
            return PlanResponse(refusal=said)
        state, asked = joints.message, dict(zip(request.goal.name, request.goal.position, strict=True))
        end = tuple(asked.get(name, at) for name, at in zip(state.name, state.position, strict=True))
        rest = (0.0,) * len(end)
        points = tuple(
            TrajectoryPoint(positions=at, velocities=rest, time_from_start=time)
            for time, at in ((0.0, state.position), (SECONDS, end))
        )
        trajectory = JointTrajectory(joint_names=state.name, points=points)
        return PlanResponse(code=PlanCode.SUCCESS, trajectory=trajectory, duration=SECONDS)

    node.serve(topics.PLAN, plan)
    node.spin()
