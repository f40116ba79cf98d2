"""A node that plans for itself: every joint goes a little further and back, sent as a trajectory to the gateway."""

from gemelo import Node, topics
from gemelo.schemas.joints import JointState
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint


def there_and_back(state: JointState, step: float = 0.02, time: float = 2.0) -> JointTrajectory:
    """Each joint by `step` [rad] or [m], and back; at rest at every point, so the gateway interpolates cubically."""
    rest = (0.0,) * len(state.name)
    away = tuple(position + step for position in state.position)
    waypoints = enumerate((state.position, away, state.position))
    points = tuple(TrajectoryPoint(positions=at, velocities=rest, time_from_start=i * time) for i, at in waypoints)
    return JointTrajectory(joint_names=state.name, points=points)


with Node("custom_planner") as node:
    joints = node.latest(topics.JOINT_STATES)
    while joints.message is None:
        node.wait(0.1)
    goal = FollowJointTrajectoryGoal(trajectory=there_and_back(joints.message))
    handle = node.action(topics.FOLLOW_JOINT_TRAJECTORY).send(goal, attached=True)
    try:
        outcome = handle.wait(timeout=60.0)
    except KeyboardInterrupt:
        handle.cancel()
        outcome = handle.wait(timeout=10.0)
    print(outcome.status.name, outcome.result.error_string, outcome.result.executed_steps, flush=True)
