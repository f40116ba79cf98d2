"""A node: prints how every trajectory goes, whoever sends it: point, time and the largest error on the way."""

from gemelo import Node
from gemelo.libraries.runtime.actions.keys import feedback_topic, status_topic
from gemelo.schemas.actions import GoalFeedback
from gemelo.schemas.message import decode
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY as FOLLOW


def show(message: GoalFeedback) -> None:
    at = decode(FOLLOW.feedback, bytes(message.feedback))
    error = max((abs(each) for each in at.error.positions), default=0.0)
    print(f"point {at.index} of {at.points}, {at.elapsed:.2f} of {at.duration:.2f} s, error {error:.5f}", flush=True)


with Node("feedback_monitor") as node:
    node.subscribe(feedback_topic(FOLLOW), show)
    newest = node.latest(status_topic(FOLLOW))
    node.spin(rate=10.0)
    for goal in newest.message.goals if newest.message else ():
        print(goal.goal_id, goal.status.name)
