"""One arm, as a script has it: ask it where it is, tell it where to go, and what stands around it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Self, Unpack

from gemelo import api
from gemelo.api.arguments import Target
from gemelo.api.errors import BadArgument
from gemelo.api.parts import Parts
from gemelo.api.units import Pose
from gemelo.libraries.arm.errors import nearest
from gemelo.schemas.device import OutputCommand, ResumeCommand, SpeedCommand, StopKind
from gemelo.schemas.joints import JointState
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import (
    DEVICE_STATUS,
    GRIPPER_STATE,
    JOINT_STATES,
    SENSORS,
    STEP_ERRORS,
    STEP_LEDGER,
    STOPPING_DISTANCE,
)

if TYPE_CHECKING:
    from gemelo.api.arguments import Grip, Joints, ToolGoal, Vector, Waypoint
    from gemelo.api.control import Control, Hold
    from gemelo.api.device import Device
    from gemelo.api.gripping import Gripped, OnGripping
    from gemelo.api.homing import OnHoming
    from gemelo.api.homing_report import HomingReport
    from gemelo.api.ledger import Ledger
    from gemelo.api.motion import Motion, OnMotion
    from gemelo.api.picking import OnPicking, Picked
    from gemelo.api.planning import Configurations, OnPlanProgress, Plan
    from gemelo.api.scene import Scene
    from gemelo.api.seeing import Seen
    from gemelo.api.session import Session
    from gemelo.api.verification import OnVerifying, Verification
    from gemelo.libraries.arm.model.description import ArmDescription
    from gemelo.libraries.runtime.node import Node
    from gemelo.schemas.deployment import Deployment
    from gemelo.schemas.gripper import GripperState
    from gemelo.schemas.ledger import StoppingDistance
    from gemelo.schemas.planning import IkRequest, JogCommand, JogStatus, PlanRequest
    from gemelo.schemas.reasons import Reason


class Arm:
    """One arm; made by `gemelo.connect`. Values are SI: metres, radians, seconds. Several arms may be in one script.

    Every method may be called from any thread but those that handle messages.

    >>> arm
    <Arm rm1: brazo_joint, antebrazo_joint, efector_joint>
    """

    def __init__(self, session: Session) -> None:
        self._session, self._parts = session, Parts(session)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Arm {self.name}: {', '.join(self.joint_names)}>"

    def close(self) -> None:
        """Ends the connection. A motion that is under way decelerates first, unless it was started detached.

        >>> second = gemelo.connect()
        >>> second.close()
        """
        try:
            self._parts.close()
        finally:
            self._session.close()

    # Who it is

    @property
    def name(self) -> str:
        """The robot's name.

        >>> arm.name
        'rm1'
        """
        return self.description.name

    @property
    def description(self) -> ArmDescription:
        """URDF, SRDF and robot.toml as one: joints with their limits, links, named states, inputs, outputs, sensors.

        >>> arm.description.joint("brazo_joint").unit
        'rad'
        """
        return self._session.description

    @property
    def deployment(self) -> Deployment:
        """The deployment file as types, with what the environment says instead: router, paths, parameters.

        >>> arm.deployment.router.host
        '127.0.0.1'
        """
        return self._session.deployment

    @property
    def joint_names(self) -> tuple[str, ...]:
        """In the order of robot.toml, which is their order everywhere.

        >>> arm.joint_names
        ('brazo_joint', 'antebrazo_joint', 'efector_joint')
        """
        return self.description.joint_names

    @property
    def states(self) -> dict[str, dict[str, float]]:
        """The named states of the SRDF: joint values [rad] or [m] by joint; some name only some joints.

        >>> arm.states["home"]
        {'brazo_joint': 0.0, 'antebrazo_joint': 0.0, 'efector_joint': 0.0}
        """
        whole = {
            name: dict(zip(self.joint_names, values, strict=True))
            for name, values in self.description.named_states.items()
        }
        return {**whole, **self.description.partial_states}

    @property
    def base_frame(self) -> str:
        """The link in which poses are given if not said otherwise.

        >>> arm.base_frame
        'base_link'
        """
        return self.description.base_frame

    @property
    def tool_frame(self) -> str:
        """The link that goals are for.

        >>> arm.tool_frame
        'efector_link'
        """
        return self.description.tool_frame

    @property
    def node(self) -> Node:
        """The node on the bus, to subscribe and publish on any topic; handlers run in its own thread.

        >>> arm.node.latest(gemelo.topics.JOINT_STATES).topic.key
        'joint_states'
        """
        return self._session.node

    # How it is

    @property
    def joints(self) -> dict[str, float]:
        """[rad] or [m] by joint: what the device has executed, or was sent if it does not say; at most 0.1 s old.

        >>> arm.move(joints={"brazo_joint": 0.3}) and round(arm.joints["brazo_joint"], 2)
        0.3
        """
        state = self._session.newest(JOINT_STATES)
        return dict(zip(state.name, state.position, strict=True))

    @property
    def velocities(self) -> dict[str, float]:
        """[rad/s] or [m/s] by joint.

        >>> max(abs(speed) for speed in arm.velocities.values()) < 0.001
        True
        """
        state = self._session.newest(JOINT_STATES)
        return dict(zip(state.name, state.velocity, strict=True))

    def pose(self, link: str = "", frame: str = "") -> Pose:
        """Where the tool (or another `link`) is in the base frame (or another `frame`).

        >>> x, y, z = arm.pose().position
        >>> arm.pose().orientation
        (..., ..., ..., ...)
        """
        return self._parts.frames.look_up(frame or self.base_frame, link or self.tool_frame)

    def frame(self, target: str, source: str, stamp: int = 0) -> Pose:
        """The pose of the frame `source` in the frame `target`, now or at `stamp` [ns UNIX] of the last 10 s.

        `stamp` is by the clock of the host that stamps `joint_states`.

        >>> arm.frame("base_link", "efector_link") == arm.pose()
        True
        """
        return self._parts.frames.look_up(target, source, stamp)

    def wait_for(self, is_so: Callable[[], bool], timeout: float | None = None) -> bool:
        """Sleeps until `is_so()`, which is called after every message; False after `timeout` [s].

        >>> arm.wait_for(lambda: False, timeout=0.1)
        False
        """
        return self._session.wait_for(is_so, timeout)

    def wake(self) -> None:
        """Lets every `wait_for` look again, for what no message tells of; from any thread.

        >>> arm.wake()
        """
        self._session.notify()

    @property
    def step_errors(self) -> dict[str, float]:
        """[steps] by joint: what the path asks for minus what the device has emitted, at the same instant.

        Empty for a board that does not say what it has executed.

        >>> all(abs(error) <= 0.5 for error in arm.step_errors.values())
        True
        """
        if self._session.newest(DEVICE_STATUS).open_loop:  # nobody knows them
            return {}
        errors = self._session.newest(STEP_ERRORS)
        return dict(zip(errors.name, errors.error, strict=True))

    @property
    def ledger(self) -> Ledger:
        """How sure it is that no joint has lost a step, and what that means at the tool: docs/ledger.md.

        >>> arm.ledger.open_loop, sorted(arm.ledger.joints) == sorted(arm.joint_names)
        (False, True)
        """
        return api.ledger.read_ledger(self._session.newest(STEP_LEDGER))

    @property
    def stopping_distance(self) -> StoppingDistance:
        """How far [m] and how long [s] the tool goes on at most if gateway, network or broker are lost now.

        >>> arm.stopping_distance.is_known, arm.stopping_distance.distance
        (True, 0.0)
        """
        return self._session.newest(STOPPING_DISTANCE)

    def require(self, *, confidence: float = 0.95) -> None:
        """Refuses below this confidence (a share) that no step is lost: now and before each later motion of this `Arm`.

        Raises `Refused` with the joint in doubt, value, limit and remedy. 0 ends it; `home` and `verify` are exempt.

        >>> try:
        ...     arm.require(confidence=1.0)
        ... except gemelo.Refused as refused:
        ...     print(refused.check, refused.limit, refused.value < 1.0, refused.remedy)
        confidence 1.0 True arm.verify()
        >>> arm.require(confidence=0.0)
        """
        self._parts.requirement.require(confidence)

    @property
    def sensors(self) -> dict[str, float]:
        """The readings of robot.toml's sensors, by name, each in the unit that robot.toml gives it.

        >>> arm.device.inject("sensor", "ultra", 0.25)
        >>> "ultra" in arm.sensors
        True
        """
        if not self.description.sensors:
            return {}
        readings = self._session.newest(SENSORS)
        return dict(zip(readings.name, readings.value, strict=True))

    @property
    def outputs(self) -> dict[str, bool]:
        """The outputs of robot.toml, and whether they are on.

        >>> arm.output("avanzar", True)
        >>> arm.outputs["avanzar"]
        True
        >>> arm.output("avanzar", False)
        """
        on = self.device.state.outputs
        return {output.name: output.name in on for output in self.description.outputs}

    @property
    def inputs(self) -> dict[str, bool]:
        """The switches of robot.toml, and whether they are active.

        >>> arm.inputs["estop"]
        False
        """
        active = self.device.state.inputs
        return {each.name: each.name in active for each in self.description.inputs}

    @property
    def device(self) -> Device:
        """The controller board.

        >>> arm.device.mode.name
        'IDLE'
        """
        return self._parts.device

    @property
    def scene(self) -> Scene:
        """What stands around the arm, and what it carries.

        >>> arm.scene.objects
        {}
        """
        return self._parts.scene

    # Who may move it

    @property
    def control(self) -> Control:
        """Who alone may move the arm; without a holder everybody may.

        >>> arm.control.held
        False
        """
        return self._parts.control

    def take_control(self, name: str = "", *, force: bool = False) -> Hold:
        """Takes control as `name` (of this node, if left out): until it is given back nobody else moves the arm.

        A motion of somebody else comes to rest first. Raises `Refused` with the holder's name where there is one,
        unless `force`. If this script dies, the arm comes to rest, and control is lost after 3 s (`control_grace`).

        >>> with arm.take_control("ana"):
        ...     try:
        ...         with gemelo.connect() as other:
        ...             other.move(named="left")
        ...     except gemelo.Refused as refused:
        ...         print(refused.check, refused.reason)
        control ana holds control of rm1, since ... from node ...: ask for it, or run `gemelo control take --force`
        """
        self._parts.control.take(name, force=force)
        return api.control.Hold(self._parts.control)

    # Where it goes

    def move(
        self,
        *,
        detached: bool = False,
        on_planning: OnPlanProgress | None = None,
        on_progress: OnMotion | None = None,
        on_cancel: OnMotion | None = None,
        **target: Unpack[Target],
    ) -> Motion:
        """Plans and goes there, and returns when the arm has arrived; the arguments are those of `gemelo.Target`.

        Raises `Refused` (nothing has moved), `Aborted`, `Lost` or `BadArgument`. At Ctrl-C the arm decelerates on its
        path, and `Interrupted` is raised when it rests. `detached`: it goes on when this script dies. `on_planning` and
        `on_progress` are called while it is planned, and while it goes; `on_cancel` once, when Ctrl-C has cancelled it.

        >>> arm.move(named="ready")
        <Motion rm1: named='ready', succeeded in ... s, ...>
        >>> arm.move(position=(0.25, 0.15, 0.10), speed=0.5)
        <Motion rm1: position=(0.25, 0.15, 0.1), speed=0.5, succeeded in ... s, ...>
        >>> arm.move(joints={"brazo_joint": gemelo.deg(30)}).status.name
        'SUCCEEDED'
        """
        plan = self.plan(on_progress=on_planning, **target)
        return self._parts.motions.run(plan, detached, on_progress, on_cancel)

    def line(
        self,
        *,
        speed: float | None = None,
        detached: bool = False,
        on_planning: OnPlanProgress | None = None,
        on_progress: OnMotion | None = None,
        on_cancel: OnMotion | None = None,
        **goal: Unpack[ToolGoal],
    ) -> Motion:
        """The tool on a straight line, at `speed` [m/s] at most; as `move` otherwise.

        >>> arm.move(named="ready").status.name
        'SUCCEEDED'
        >>> shares = []
        >>> arm.line(offset=(0.0, 0.0, -0.02), speed=0.05, on_progress=lambda motion: shares.append(motion.progress))
        <Motion rm1: offset=(0, 0, -0.02), line=True, tool_speed=0.05, succeeded in ... s, ...>
        >>> shares == sorted(shares) and shares[-1] <= 1.0
        True
        """
        target = api.targets.as_target(goal)
        target["line"] = True
        return self.move(
            **_with_speed(target, speed),
            detached=detached,
            on_planning=on_planning,
            on_progress=on_progress,
            on_cancel=on_cancel,
        )

    def arc(
        self,
        *,
        through: Vector | None = None,
        center: Vector | None = None,
        to: Vector | Pose | None = None,
        speed: float | None = None,
        detached: bool = False,
        on_planning: OnPlanProgress | None = None,
        on_progress: OnMotion | None = None,
        on_cancel: OnMotion | None = None,
        **goal: Unpack[ToolGoal],
    ) -> Motion:
        """The tool on an arc through (or about) a point (3,) [m] to `to`, at `speed` [m/s] at most.

        >>> arm.move(position=(0.20, 0.30, 0.12)).status.name
        'SUCCEEDED'
        >>> arm.arc(through=(0.15, 0.34, 0.12), to=(0.10, 0.35, 0.12)).status.name
        'SUCCEEDED'
        """
        if (through is None) == (center is None):
            raise BadArgument(because("argument.arc", choices=("through", "center")))
        target = api.targets.as_target(goal)
        if isinstance(to, Pose):
            target["pose"] = to
        elif to is not None:
            target["position"] = to
        if through is not None:
            target["through"] = through
        if center is not None:
            target["center"] = center
        return self.move(
            **_with_speed(target, speed),
            detached=detached,
            on_planning=on_planning,
            on_progress=on_progress,
            on_cancel=on_cancel,
        )

    def path(
        self,
        waypoints: Sequence[Waypoint],
        *,
        detached: bool = False,
        on_planning: OnPlanProgress | None = None,
        on_progress: OnMotion | None = None,
        on_cancel: OnMotion | None = None,
        **target: Unpack[Target],
    ) -> Motion:
        """Through the points in order: positions (3,) [m], poses, named states, joints by name; it stops at the last.

        Corners may be cut within `blend=` [m] of a point. With `line=True` the tool goes straight between them.

        >>> arm.path([(0.25, 0.05, 0.15), (0.25, 0.10, 0.15), (0.25, 0.15, 0.10)], blend=0.01).status.name
        'SUCCEEDED'
        """
        if not waypoints:
            raise BadArgument(because("argument.path.no_point"))
        target.update(_goal_of(waypoints[-1]))
        if len(waypoints) > 1:
            target["via"] = tuple(waypoints[:-1])
        return self.move(
            **target, detached=detached, on_planning=on_planning, on_progress=on_progress, on_cancel=on_cancel
        )

    def plan(
        self,
        request: PlanRequest | None = None,
        *,
        on_progress: OnPlanProgress | None = None,
        **target: Unpack[Target],
    ) -> Plan:
        """A verified trajectory, for `execute` or `start`; nothing moves. The arguments are those of `move`.

        The planner's own message may be given instead of them, as `request`.

        >>> plan = arm.plan(named="left")
        >>> arm.execute(plan).status.name
        'SUCCEEDED'
        >>> from gemelo.schemas.planning import NamedGoal, PlanRequest
        >>> arm.plan(PlanRequest(goal=NamedGoal(name="ready"))).duration > 0.0
        True
        """
        if request is None:
            request = api.targets.request_of(self.description, target, self._parts.frames.look_up)
        elif target:
            raise BadArgument(because("argument.goal.request", given=next(iter(target))))
        with api.control.named_where_another_moves(self._parts.control, self.name):
            return api.planning.make_plan(self._session, request, target, on_progress)

    def execute(
        self,
        plan: Plan,
        *,
        detached: bool = False,
        on_progress: OnMotion | None = None,
        on_cancel: OnMotion | None = None,
    ) -> Motion:
        """Goes along the plan, and returns when the arm has arrived. It must begin where the arm is.

        >>> arm.execute(arm.plan(named="lifted")).status.name
        'SUCCEEDED'
        """
        return self._parts.motions.run(plan, detached, on_progress, on_cancel)

    def start(
        self,
        plan: Plan | None = None,
        *,
        detached: bool = False,
        after: Motion | None = None,
        **target: Unpack[Target],
    ) -> Motion:
        """As `execute` and `move`, but returns as soon as the arm goes.

        A motion of this connection that still runs gives way to a target: it is slowed to rest on its path, as by
        `cancel`, and the plan begins there. A plan must begin where the arm stands, and is refused while it moves.

        `after`: the plan begins where that motion ends, and in the same instant, without a pause. One motion can wait
        behind another; it is over too when that one ends before its goal.

        >>> motion = arm.start(named="left")
        >>> motion.is_over
        False
        >>> motion.wait().status.name
        'SUCCEEDED'
        >>> first = arm.start(named="ready")
        >>> arm.start(named="lifted").wait().status.name, first.status.name
        ('SUCCEEDED', 'CANCELED')
        >>> first = arm.start(named="ready")
        >>> second = arm.start(arm.plan(named="left", from_joints=first.plan.end), after=first)
        >>> first.wait().status.name, second.wait().status.name
        ('SUCCEEDED', 'SUCCEEDED')
        """
        if (plan is None) == (not target):
            raise BadArgument(because("argument.goal.plan"))
        if target and after is not None and "from_joints" not in target:
            target["from_joints"] = after.plan.end
        if target and after is None:
            self._parts.motions.bring_to_rest()
        return self._parts.motions.start(plan if plan is not None else self.plan(**target), detached, after=after)

    def home(
        self, *joints: str, on_progress: OnHoming | None = None, on_cancel: Callable[[], object] | None = None
    ) -> HomingReport:
        """The joints find their switches, all that have one if none is named; returns when they are home.

        `on_progress` gets what each joint does, by name, at every change and 5 times a second between. At Ctrl-C the
        joints decelerate, `on_cancel` is called, and `Interrupted` raised when they rest. Homing is the device's own
        motion: it goes on to its end when this script dies.

        >>> arm.home("efector_joint").homed
        ('efector_joint',)
        """
        return api.homing.home(self._session, joints, self.device.command, on_progress, on_cancel)

    def verify(self, *joints: str, on_progress: OnVerifying | None = None) -> Verification:
        """Verifies the joints by their switches, all that have one if none is named, on the shortest trip.

        A home switch within the joint's limits is passed in a planned motion, and the arm returns; where it is a limit
        switch, lies beyond the limits, was not seen, or where steps were lost, the joint homes. Raises `Refused` where
        no switch can verify any of them; `on_progress` is called with a sentence for each part of the trip.

        >>> arm.verify("efector_joint").homed
        ('efector_joint',)
        """
        with self._parts.requirement.suspended():
            return api.verification.verify(
                self, joints, lambda plan: self._parts.motions.run(plan, False, None, None), on_progress
            )

    def reference(self, joints: Joints | None = None) -> None:
        """Declares where the joints stand, [rad] or [m] by name; the others are at robot.toml's reference position.

        >>> where = arm.joints
        >>> arm.reference(where)
        """
        given = api.targets.joint_state(self.description, joints, "joints") if joints is not None else JointState()
        values = dict(zip(given.name, given.position, strict=True))
        self.device.command(api.device.reference_command(self.description, values))

    def jog(
        self,
        command: JogCommand | None = None,
        *,
        joints: Joints | None = None,
        twist: Vector | None = None,
        frame: str = "",
        duration: float | None = None,
        on_progress: Callable[[JogStatus], object] | None = None,
    ) -> JogStatus | None:
        """Moves by hand: the joints at speeds [rad/s] or [m/s] by name, or the tool with a twist.

        `twist`: (vx, vy, vz) [m/s], or with (wx, wy, wz) [rad/s] after it, along the axes of `frame`, the base's or the
        tool's. A command holds for 0.1 s: without `duration` [s] say it again and again, at 50 Hz; silence stops the
        arm. The answer is the planner's newest word, None before the first: how much of the speed is left, and what
        limits it. The planner's own message may be given instead of speeds, as `command`.

        >>> arm.jog(joints={"brazo_joint": 0.2}, duration=0.3).active
        False
        >>> arm.jog(twist=(0.0, 0.0, 0.02), duration=0.3).active
        False
        """
        if command is None:
            command = api.jog.jog_command(self.description, joints, twist, frame)
        elif joints is not None or twist is not None or frame:
            raise BadArgument(because("argument.jog.command", others=("joints", "twist")))
        self._parts.require_motion()
        if duration is None:
            return self._parts.jogging.say(command)
        return self._parts.jogging.hold(command, duration, on_progress)

    def end_jog(self) -> JogStatus | None:
        """Says no more `jog`, and returns when the arm rests: the planner's last word, None where nothing was said.

        >>> arm.jog(joints={"brazo_joint": 0.1})
        >>> arm.end_jog().active
        False
        """
        return self._parts.jogging.end()

    def stream(
        self,
        joints: Joints | None = None,
        velocity: Joints | None = None,
        *,
        ahead: Iterable[Joints] = (),
        period: float = 0.0,
        pose: Pose | Vector | None = None,
    ) -> JogStatus | None:
        """A target [rad] or [m] that the arm follows within its limits, now; the newest wins. No path is planned.

        Call it 20 to 100 times a second: the arm brakes 0.11 s after the last one, and rests there where it is near.
        The stream ends 0.5 s after it. `velocity` [rad/s] or [m/s] there is estimated if left out; zeros are a place to
        rest at. `ahead` is a chunk: one more target every `period` [s], which the arm plays until it rests at the last
        one. A new call replaces what of it is not due yet. A target that the gateway has refused raises `Refused` at
        the next call, a gateway that says nothing for 1 s `Lost`.

        Where something is in the way, the arm stops clear of it, and the status that is returned says what it is.

        With `pose` the tool follows a pose, or a position (3,) [m] with the tool turned as it is, in the base: from the
        configuration where the arm is, slowed near singularities and joint limits. What limits it is in the status that
        is returned; a pose out of reach raises `Refused`, the arm stands as near as it gets, and follows the next one
        within reach.

        >>> for step in range(20):
        ...     arm.stream({"brazo_joint": arm.joints["brazo_joint"] + 0.002})
        >>> at = arm.joints["brazo_joint"]
        >>> chunk = [{"brazo_joint": at - 0.001 * step} for step in range(50)]
        >>> arm.stream(chunk[0], ahead=chunk[1:], period=0.02)
        """
        self._parts.require_motion()
        if pose is None:
            if joints is None:
                raise BadArgument(because("argument.stream.which", joints="joints", pose="pose"))
            return self._parts.streaming.say(joints, velocity, ahead, period)
        if joints is not None or velocity is not None or ahead or period:
            raise BadArgument(because("argument.stream.pose", argument="pose"))
        return self._parts.streaming.lead(pose)

    def grip(
        self,
        to: Grip,
        *,
        max_effort: float = 0.0,
        on_progress: OnGripping | None = None,
        is_cancelled: Callable[[], bool] | None = None,
    ) -> Gripped:
        """Opens or closes the gripper: to "open", "close", or an opening [m]; returns when it is there, or holds.

        What the scene has between the jaws is attached to the tool when they close on it, and left where it is when
        they open. `max_effort` [N]: refused where the gripper presses with more. At Ctrl-C it stays where it is, and
        `Interrupted` is raised; it stays too once `is_cancelled()`, which raises `Canceled`. Raises `Refused`,
        `Aborted`, `Lost` or `BadArgument`.

        >>> arm.grip("open").reached
        True
        >>> abs(arm.grip(0.025).position - 0.025) < 0.002
        True
        >>> print(arm.grip("close"))
        0... mm, there
        """
        self._parts.control.prepare()
        return self._parts.gripping.go(to, max_effort, on_progress, is_cancelled)

    @property
    def gripper(self) -> GripperState:
        """The gripper: its opening [m], whether that is measured, and whether it presses.

        >>> arm.grip("open").reached, arm.gripper.measured, arm.gripper.stalled
        (True, True, False)
        """
        return self._session.newest(GRIPPER_STATE)

    # What is switched

    def stop(self) -> None:
        """Decelerates on the path and forgets the rest of it.

        >>> arm.stop()
        """
        self.device.command(StopKind.STOP)

    def hold(self) -> None:
        """Decelerates on the path and stands there; `resume` goes on.

        >>> motion = arm.start(named="left", speed=0.5)
        >>> arm.hold()
        >>> arm.resume()
        >>> motion.wait().status.name
        'SUCCEEDED'
        """
        self.device.command(StopKind.HOLD)

    def resume(self) -> None:
        """Goes on along the path after `hold`; `Refused` where nothing is held.

        >>> motion = arm.start(named="right")
        >>> arm.hold()
        >>> arm.resume()
        >>> motion.wait().status.name
        'SUCCEEDED'
        """
        self.device.command(ResumeCommand())

    def speed(self, share: float) -> None:
        """Plays every path at `share` (0 to 1) of its planned speed from now on, also what is under way.

        >>> arm.speed(0.5)
        >>> arm.speed(1.0)
        """
        if not 0.0 <= share <= 1.0:
            raise BadArgument(because("argument.speed", *api.targets.per_cent(share), value=share))
        self.device.command(SpeedCommand(scale=float(share)))

    def output(self, name: str, on: bool) -> None:
        """Switches an output of robot.toml.

        >>> arm.output("avanzar", True)
        >>> arm.output("avanzar", False)
        """
        known = [output.name for output in self.description.outputs]
        if name not in known:
            raise BadArgument(because("argument.output.unknown", nearest(name, known), robot=self.name, name=name))
        self.device.command(OutputCommand(output=name, on=on), f"output {name}")

    # What it sees

    def detect(self, name: str = "", *, camera: str = "", scene: bool = False) -> tuple[Seen, ...]:
        """The things and places of cell.toml that cameras see, by name: all, or the one of that `name`.

        The arm must stand. Five images are taken, and their median. `camera`: only that one looks. `scene`: what is
        sure enough becomes a box of the planning scene, with three standard deviations around it. Raises `Refused`
        where the twin has no cell, the thing is not seen, or an image cannot be trusted.

        >>> try:
        ...     arm.detect("cup")
        ... except gemelo.Refused as refused:
        ...     print(refused.check)
        cell
        """
        return self._parts.eyes.detect(name, camera, scene)

    def pick(
        self,
        name: str,
        *,
        to: str,
        camera: str = "",
        on_progress: OnPicking | None = None,
        is_cancelled: Callable[[], bool] | None = None,
    ) -> Picked:
        """Takes the thing `name` of cell.toml from where a camera sees it to the place `to`.

        From above, straight down, with the thing attached while it is carried; a gripper that closes on nothing is
        tried twice. `on_progress` is called with a `Reason` for each part, whose `str()` is a sentence. Once
        `is_cancelled()` the arm decelerates, and `Canceled` is raised. Raises `Refused` before anything has moved: not
        seen, seen twice, not known well enough, out of reach, too wide or too flat for the jaws; and `Aborted` with the
        thing where it is then.

        >>> try:
        ...     arm.pick("cup", to="bin")
        ... except gemelo.Refused as refused:
        ...     print(refused.check)
        cell
        """
        with_words = on_progress if on_progress is not None else _silent
        return api.picking.pick(self, self._parts.eyes, name, to, camera, with_words, is_cancelled or _never)

    def require_pickable(self, name: str, to: str) -> None:
        """Raises `Refused` without a gripper or a cell, `BadArgument` for a thing or place that the cell has not.

        >>> try:
        ...     arm.require_pickable("cup", to="bin")
        ... except gemelo.Refused as refused:
        ...     print(refused.check)
        cell
        """
        api.picking.named(self, self._parts.eyes, name, to)

    # What could be

    def ik(
        self,
        request: IkRequest | None = None,
        *,
        near: Joints | None = None,
        solutions: int = 1,
        touching: bool = False,
        **goal: Unpack[ToolGoal],
    ) -> Configurations:
        """Joint values [rad] or [m] that bring the tool there, at most so many, nearest first; nothing moves.

        Near to `near`, or to where the arm is; `touching`: also those at which links touch. The planner's own message
        may be given instead, as `request`. Raises `Refused`.

        >>> arm.ik(position=(0.25, 0.15, 0.10))
        [{'brazo_joint': ..., 'antebrazo_joint': ..., 'efector_joint': ...}]
        """
        if request is None:
            request = api.targets.ik_request(
                self.description, goal, self._parts.frames.look_up, near, solutions, touching
            )
        elif goal or near is not None or solutions != 1 or touching:
            raise BadArgument(because("argument.goal.request", given=next(iter(goal))))
        return api.planning.find_configurations(self._session, request, goal)

    def fk(self, joints: Joints | None = None) -> Pose:
        """Where the tool is for joint values [rad] or [m]; joints that are not named stand as they do now.

        >>> arm.fk({"brazo_joint": 0.0, "antebrazo_joint": 0.0, "efector_joint": 0.0}).position
        (..., ..., ...)
        """
        return api.planning.find_poses(self._session, joints, ())[self.tool_frame]

    def check(self, joints: Joints) -> None:
        """Raises `Refused` where the arm may not stand, with the nearest joint values at which it may; nothing moves.

        `joints`: [rad] or [m] by name, the others as they stand now. Limits, the arm itself and the scene are checked.

        >>> arm.check({"brazo_joint": 0.3})
        >>> try:
        ...     arm.check({"brazo_joint": 9.0})
        ... except gemelo.Refused as refused:
        ...     print(refused.check, refused.nearest)
        joint limit {'joints': {'brazo_joint': ...}}
        """
        api.planning.require_valid(self._session, joints)

    def link_poses(self, joints: Joints | None = None, links: Sequence[str] = ()) -> dict[str, Pose]:
        """As `fk`, for `links`, or for all.

        >>> sorted(arm.link_poses(links=["base_link"]))
        ['base_link']
        """
        return api.planning.find_poses(self._session, joints, tuple(links) or self.description.model.link_names)


def _silent(part: Reason) -> None:
    """For a caller that wants no progress."""


def _never() -> bool:
    """Nobody can cancel it."""
    return False


def _with_speed(target: Target, speed: float | None) -> Target:
    if speed is not None:
        target["tool_speed"] = speed
    return target


def _goal_of(waypoint: Waypoint) -> Target:
    if isinstance(waypoint, str):
        return Target(named=waypoint)
    if isinstance(waypoint, Mapping):
        return Target(joints=waypoint)
    return Target(pose=waypoint) if isinstance(waypoint, Pose) else Target(position=waypoint)
