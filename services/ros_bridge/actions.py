"""The server of an action of ROS 2: five entities around goals that are ours.

A goal has the UUID that its client chose, so that it is decided once however often it is sent. What a client of ROS
asked for ends with it: its token is watched, and with the token its goals are cancelled and its questions dropped.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from gemelo.libraries.ros2.messages import nanoseconds, time_of
from gemelo.libraries.ros2.types import BadRosMessage, decode, encode, make, ros_type
from gemelo.libraries.runtime.actions.goal_handle import GoalHandle
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.ros_wire.names import DEFAULT, LATCHED, Qos, RosType
from gemelo.libraries.runtime.ros_wire.ros_node import RosPublication, RosQuery
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.reasons import Reason
from gemelo.services.ros_bridge.core import status_in_ros, uuid_of

KEPT = 60.0  # [s] for which a result can be asked for; chosen: rcl keeps it 10 s to 15 min
MOST_DECISIONS = 256  # that are remembered; chosen: more goals than a client sends again
NONE, REJECTED, UNKNOWN_GOAL, TERMINATED = 0, 1, 2, 3  # of action_msgs/CancelGoal
NO_UUID = bytes(16)

AnyHandle = GoalHandle[Any, Any]
OnRefusal = Callable[[Reason | None], None]
Decided = Callable[[AnyHandle | Reason], None]


class Entities(Protocol):
    """A node of ROS 2."""

    def publisher(self, name: str, kind: RosType, qos: Qos = DEFAULT) -> RosPublication: ...

    def serve(self, name: str, kind: RosType, on_query: Callable[[RosQuery], None]) -> None: ...


class RosAction(Protocol):
    """What is particular to one action."""

    kind: str  # control_msgs/action/...
    name: str

    def begin(self, uuid: bytes, goal: Any, decided: Decided) -> None:
        """Has the goal decided; `decided(handle)` or `decided(reason)` is called once, now or later."""
        ...

    def result(self, handle: AnyHandle) -> Any:
        """Of a goal that is over."""
        ...

    def no_result(self) -> Any:
        """Of a goal that is not known."""
        ...

    def ended(self) -> None:
        """A goal that was accepted is over."""
        ...


@dataclass
class RosGoal:
    """A goal that was accepted."""

    uuid: bytes
    client: bytes  # the GID of who sent it
    stamp: int  # [ns] UNIX time of the acceptance
    handle: AnyHandle
    status: GoalStatusCode = GoalStatusCode.EXECUTING
    waiting: list[RosQuery] = field(default_factory=list)  # for its result
    ended: float | None = None  # [s] monotonic


class RosActionServer:
    """One action on the node of ROS."""

    def __init__(self, node: Node, ros: Entities, action: RosAction, on_refusal: OnRefusal) -> None:
        """`on_refusal(reason)` is called for a goal that is refused, which ROS itself cannot say, and with None for
        one that is accepted."""
        self._node, self._action, self._on_refusal = node, action, on_refusal
        self._goals: dict[bytes, RosGoal] = {}
        self._deciding: dict[bytes, list[RosQuery]] = {}
        self._decisions: OrderedDict[bytes, bytes] = OrderedDict()  # the answers that were given
        self._gone: set[bytes] = set()  # GIDs that vanished while a goal of theirs was being decided
        self._on_status = ros.publisher(
            f"{action.name}/_action/status", ros_type("action_msgs/msg/GoalStatusArray"), LATCHED
        )
        for name, kind, answer in (
            ("send_goal", f"{action.kind}_SendGoal", self._send_goal),
            ("cancel_goal", "action_msgs/srv/CancelGoal", self._cancel_goal),
            ("get_result", f"{action.kind}_GetResult", self._get_result),
        ):
            ros.serve(f"{action.name}/_action/{name}", ros_type(kind), _decoded(f"{kind}_Request", answer))
        node.every(1.0, self._forget)
        self._publish_status()

    def on_client(self, gid: bytes, is_there: bool) -> None:
        """A client of ROS has come or gone: with it go its goals and its questions."""
        if is_there:
            return
        if any(query.client == gid for queries in self._deciding.values() for query in queries):
            self._gone.add(gid)
        for goal in self._goals.values():
            for query in [each for each in goal.waiting if each.client == gid]:
                goal.waiting.remove(query)
                query.drop()
            if goal.client == gid and goal.ended is None:
                self._cancel(goal)

    def _send_goal(self, query: RosQuery, request: Any) -> None:
        uuid = bytes(request.goal_id.uuid)
        if uuid in self._decisions:
            query.reply(self._decisions[uuid])
        elif uuid in self._deciding:
            self._deciding[uuid].append(query)
        else:
            self._deciding[uuid] = [query]
            self._action.begin(uuid, request.goal, lambda decision: self._decided(uuid, decision))

    def _decided(self, uuid: bytes, decision: AnyHandle | Reason) -> None:
        queries, now = self._deciding.pop(uuid), self._node.now()
        accepted = not isinstance(decision, Reason)
        answer = encode(make(f"{self._action.kind}_SendGoal_Response", accepted=accepted, stamp=time_of(now)))
        self._decisions[uuid] = answer
        while len(self._decisions) > MOST_DECISIONS:
            self._decisions.popitem(last=False)
        for query in queries:
            query.reply(answer)
        self._on_refusal(decision if isinstance(decision, Reason) else None)
        if isinstance(decision, Reason):
            self._gone.discard(queries[0].client)
        else:
            self._accept(RosGoal(uuid, queries[0].client, now, decision))

    def _accept(self, goal: RosGoal) -> None:
        self._goals[goal.uuid] = goal
        goal.handle.on_end = lambda: self._end(goal)
        if goal.handle.is_over:
            self._end(goal)
            return
        if goal.client in self._gone:
            self._gone.discard(goal.client)
            self._cancel(goal)
        self._publish_status()

    def _end(self, goal: RosGoal) -> None:
        outcome = goal.handle.outcome
        goal.status = outcome.status if outcome is not None else GoalStatusCode.ABORTED
        goal.ended = self._node.monotonic()
        self._action.ended()
        self._publish_status()
        answer = self._result_of(goal)
        while goal.waiting:
            goal.waiting.pop().reply(answer)

    def _result_of(self, goal: RosGoal) -> bytes:
        return self._answered(status_in_ros(goal.status), self._action.result(goal.handle))

    def _answered(self, status: int, result: Any) -> bytes:
        return encode(make(f"{self._action.kind}_GetResult_Response", status=status, result=result))

    def _get_result(self, query: RosQuery, request: Any) -> None:
        goal = self._goals.get(bytes(request.goal_id.uuid))
        if goal is None:
            query.reply(self._answered(int(GoalStatusCode.UNKNOWN), self._action.no_result()))
        elif goal.ended is not None:
            query.reply(self._result_of(goal))
        else:
            goal.waiting.append(query)

    def _cancel_goal(self, query: RosQuery, request: Any) -> None:
        uuid, until = bytes(request.goal_info.goal_id.uuid), nanoseconds(request.goal_info.stamp)
        code, chosen = self._chosen(uuid, until)
        for goal in chosen:
            self._cancel(goal)
        infos = [_info(goal) for goal in chosen]
        query.reply(encode(make("action_msgs/srv/CancelGoal_Response", return_code=code, goals_canceling=infos)))
        self._publish_status()

    def _chosen(self, uuid: bytes, until: int) -> tuple[int, list[RosGoal]]:
        """The code of the answer and the goals: one, all, or all that were accepted `until` [ns]."""
        active = [goal for goal in self._goals.values() if goal.ended is None]
        named = self._goals.get(uuid)
        if uuid == NO_UUID:
            return NONE, [goal for goal in active if not until or goal.stamp <= until]
        if until:
            return NONE, [goal for goal in active if goal is named or goal.stamp <= until]
        if named is None:
            return UNKNOWN_GOAL, []
        return (TERMINATED, []) if named.ended is not None else (NONE, [named])

    def _cancel(self, goal: RosGoal) -> None:
        """How it ends is then its result: it may succeed yet."""
        goal.status = GoalStatusCode.CANCELING
        goal.handle.cancel()

    def _publish_status(self) -> None:
        goals = [
            make("action_msgs/msg/GoalStatus", goal_info=_info(goal), status=status_in_ros(goal.status))
            for goal in self._goals.values()
        ]
        message = make("action_msgs/msg/GoalStatusArray", status_list=goals)
        self._on_status.put(encode(message), self._node.now())

    def _forget(self) -> None:
        """Results that nobody has to ask for any more."""
        now = self._node.monotonic()
        old = [uuid for uuid, goal in self._goals.items() if goal.ended is not None and now - goal.ended > KEPT]
        for uuid in old:
            del self._goals[uuid]
        if old:
            self._publish_status()


def _decoded(kind: str, answer: Callable[[RosQuery, Any], None]) -> Callable[[RosQuery], None]:
    def on_query(query: RosQuery) -> None:
        try:
            request = decode(kind, query.payload)
        except BadRosMessage:
            query.drop()
        else:
            answer(query, request)

    return on_query


def _info(goal: RosGoal) -> Any:
    return make("action_msgs/msg/GoalInfo", goal_id=uuid_of(goal.uuid), stamp=time_of(goal.stamp))
