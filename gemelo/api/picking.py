"""Picks a thing that a camera sees and places it: approach, grip, carry, release; each motion planned and verified."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

from gemelo.api.arguments import Grip
from gemelo.api.errors import Aborted, BadArgument, Canceled, Lost, Refused, reason_of
from gemelo.api.grasping import grasp_point, lift_above, looking_down, turn_between, yaw_of
from gemelo.api.gripping import Gripped
from gemelo.api.motion import Motion
from gemelo.api.moving_arm import MovingArm
from gemelo.api.planning import Plan
from gemelo.api.seeing import Eyes, Seen, add_to_scene, body_of
from gemelo.api.targets import FULL
from gemelo.api.units import Point, Pose
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.frames.transforms import IDENTITY, Rigid, compose, from_axis_angle
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.cell import Place, PosePlace, Thing
from gemelo.schemas.grippers.kinds import Gripper
from gemelo.schemas.reasons import Reason, Value, because, plain, remedy

APPROACH = 0.04  # [m] the straight way down to a thing, and up with it
SLOW = 0.05  # [m/s] down and up
BESIDE = 0.001  # [m] that the open jaws must have in all beside the thing
MOST_TURN = math.radians(35.0)  # that closing jaws may turn a thing by: beyond it a square one jams
ATTEMPTS = 2
STAYED = 0.01  # [m] a thing that is seen nearer than that to where it stood was not taken
DOWN = (0.0, 0.0, -1.0)
NO_GOOD_IMAGE = ("camera", "moving")  # checks of a `Refused` for the images, not for what they show
SEEN_TURN = 0.01  # [rad] of the jaws' turn from which on it is said
DONE = {  # by whether the jaws have turned it, and whether it took several attempts
    (False, False): "pick.done", (True, False): "pick.done.turned", (False, True): "pick.done.again",
    (True, True): "pick.done.turned_again",
}  # fmt: skip
SOLUTIONS = 8  # configurations of a tool pose that are considered

OnPicking = Callable[[Reason], object]  # one line for a person, as data; `str()` of it is English
IsCancelled = Callable[[], bool]


class Picked(NamedTuple):
    """A thing that was taken and put down.

    >>> picked = gemelo.Picked("cup", "bin", gemelo.Pose((0.2, 0.1, 0.04)), 0.0001, 0.1, 1, 12.5, None, "no image")
    >>> print(picked)
    cup is at bin: seen +-0.1 mm, turned 6 deg by the jaws, 12.5 s; not seen afterwards: no image
    """

    name: str
    place: str
    seen: Pose  # in the base frame, as it was seen before it was taken
    sigma: float  # [m] standard deviation of that
    turned: float  # [rad] by the jaws, as they closed
    attempts: int
    took: float  # [s]
    after: Pose | None  # in the base frame, as it was seen afterwards; None where it was not, as behind the arm
    unseen: str = ""  # why it was not seen afterwards
    why: Reason | None = None  # the same as data

    @property
    def summary(self) -> Reason:
        """One line for a person, as data.

        >>> gemelo.Picked("cup", "bin", gemelo.Pose((0.2, 0.1, 0.04)), 0.0001, 0.1, 2, 12.5, None).summary.code
        'pick.done.turned_again'
        """
        values: dict[str, Value] = {"thing": self.name, "place": self.place, "time": self.took}
        has_turned, is_again = abs(self.turned) > SEEN_TURN, self.attempts != 1
        values |= {"angle": math.degrees(self.turned)} if has_turned else {}
        values |= {"count": self.attempts} if is_again else {}
        done = because(DONE[has_turned, is_again], error=1e3 * self.sigma, **values)
        return because("pick.done.unseen", done, self.why or plain(self.unseen)) if self.unseen else done

    def __str__(self) -> str:
        """One line for a person."""
        return str(self.summary)


@dataclass(frozen=True)
class Approach:
    """How to come to a point from above."""

    above: Mapping[str, float]  # joint values at the tool's pose `APPROACH` above
    turned: float  # [rad] from the thing's nearest side to the jaws


@dataclass(frozen=True)
class Hand:
    """What moves while a thing is picked, each motion slowed down and ended once it is cancelled."""

    arm: MovingArm
    tell: OnPicking
    is_cancelled: Callable[[], bool]

    def move(self, joints: Mapping[str, float]) -> None:
        """Plans and goes to the joints [rad] or [m]."""
        self._follow(self.arm.plan(joints=joints))

    def go_straight(self, height: float) -> None:
        """Up by `height` [m], or down where that is negative."""
        self._follow(self.arm.plan(offset=(0.0, 0.0, height), line=True, tool_speed=SLOW))

    def grip(self, to: Grip) -> Gripped:
        """Opens or closes the jaws."""
        self._proceed()
        return self.arm.grip(to, is_cancelled=self.is_cancelled)

    def _follow(self, plan: Plan) -> None:
        self._proceed()
        self.arm.execute(plan, on_progress=self._look)
        self._proceed()

    def _look(self, motion: Motion) -> None:
        if self.is_cancelled():
            motion.cancel()

    def _proceed(self) -> None:
        if self.is_cancelled():
            raise Canceled(because("pick.canceled"), GoalStatusCode.CANCELED)


def pick(
    arm: MovingArm, eyes: Eyes, name: str, to: str, camera: str, tell: OnPicking, is_cancelled: IsCancelled
) -> Picked:
    """Takes the thing `name` to the place `to`; raises what `Arm.pick` raises."""
    hand = Hand(arm, tell, is_cancelled)
    began = arm.node.monotonic()
    thing, place, gripper = named(arm, eyes, name, to)
    for attempt in range(1, ATTEMPTS + 1):
        seen = eyes.one(name, camera)
        tell(seen.summary)
        lift = lift_above(thing, gripper, seen)
        grasp = grasp_point(thing, seen)
        way = _way_to(arm, thing, seen, (grasp[0], grasp[1], grasp[2] + lift), gripper)
        spot = _spot(eyes, place, camera)
        tell(because("pick.place", place=to, at=tuple(1e3 * value for value in spot)))
        release = _configuration_above(arm, (spot[0], spot[1], spot[2] + lift), _yaw_at(arm, place, seen, way))
        add_to_scene(arm.scene, thing, seen)
        try:
            if _take(hand, thing, seen, way):
                _put(hand, name, release)
                after, unseen = _seen_afterwards(hand, eyes, seen, camera, spot)
                took, said = arm.node.monotonic() - began, "" if unseen is None else str(unseen)
                return Picked(name, to, seen.pose, seen.sigma, way.turned, attempt, took, after, said, unseen)
        finally:
            if name in arm.scene.objects and not arm.scene.objects[name].attached:
                arm.scene.remove(name)
        tell(because("pick.nothing"))
    raise Aborted(because("pick.not_gripped", remedy("look_for_it"), thing=name, count=ATTEMPTS))


def _seen_afterwards(
    hand: Hand, eyes: Eyes, before: Seen, camera: str, spot: Point
) -> tuple[Pose | None, Reason | None]:
    """Where the thing is seen now, or why it is not; raises `Aborted` where it still stands where it was.

    Jaws that measure nothing are said to hold what the scene has between them: what is believed, not what is there.
    """
    try:
        now = look_twice(eyes, before.name, camera)
    except (Refused, Lost) as error:
        return None, error.message
    hand.tell(now.summary)
    here, stood = now.pose.position, before.pose.position
    if math.dist(here, stood) < STAYED < math.dist(spot[:2], stood[:2]):
        x, y, z = (1e3 * value for value in here)
        raise Aborted(because("pick.still_there", remedy("check_camera"), thing=before.name, x=x, y=y, z=z))
    return now.pose, None


def look_twice(eyes: Eyes, name: str, camera: str) -> Seen:
    """The thing as it is seen; looks again where no image could be used, as on a host that is busy."""
    try:
        return eyes.one(name, camera)
    except (Refused, Lost) as error:
        if isinstance(error, Refused) and error.check not in NO_GOOD_IMAGE:
            raise
        return eyes.one(name, camera)


def named(arm: MovingArm, eyes: Eyes, name: str, to: str) -> tuple[Thing, Place, Gripper]:
    """What the cell and the arm have for it; raises `Refused` without a cell or gripper, `BadArgument` for a name."""
    cell = eyes.cell()
    gripper = arm.description.gripper
    if gripper is None:
        raise Refused(because("client.no_gripper", robot=arm.name), check="gripper")
    try:
        return cell.thing(name), cell.place(to), gripper
    except DescriptionError as error:
        raise BadArgument(reason_of(error)) from error


def _way_to(arm: MovingArm, thing: Thing, seen: Seen, tool: Point, gripper: Gripper) -> Approach:
    """The configuration above the thing at which the jaws turn it least; raises `Refused`."""
    size, center = body_of(thing)
    body = compose((seen.pose.position, seen.pose.orientation), center)
    above = (tool[0], tool[1], tool[2] + APPROACH)
    ways = []
    for joints in _configurations_above(arm, above, body, size, gripper):
        pose = arm.fk(joints)
        turned, side = turn_between(pose, body, size)
        ways.append((turned, side, joints))
    ways.sort(key=lambda each: abs(each[0]))
    turned, side, joints = ways[0]
    other = size[1] if side == size[0] else size[0]
    width = side * math.cos(turned) + other * abs(math.sin(turned))
    if width + BESIDE > gripper.open or abs(turned) > MOST_TURN:
        raise Refused(
            because(
                "pick.turned", thing=thing.name, angle=math.degrees(abs(turned)), width=width, open=gripper.open
            ),
            check="grasp", subject=thing.name, value=width, limit=gripper.open,
        )  # fmt: skip
    return Approach(joints, turned)


def _configurations_above(
    arm: MovingArm, above: Point, body: Rigid, size: Point, gripper: Gripper
) -> list[Mapping[str, float]]:
    """With the jaws along the thing's sides where the arm can turn its tool, else as they come; raises `Refused`."""
    if len(arm.joint_names) < FULL:
        return list(arm.ik(position=above, solutions=SOLUTIONS))
    yaw = yaw_of(body[1])
    refused: Refused | None = None
    found: list[Mapping[str, float]] = []
    for quarter in range(4):
        side = size[1] if quarter % 2 == 0 else size[0]
        if side + BESIDE > gripper.open:
            continue
        try:
            turn = looking_down(yaw + quarter * math.pi / 2.0)
            found += arm.ik(pose=Pose(above, turn), solutions=2)
        except Refused as error:
            refused = refused or error
    if not found:
        raise refused or Refused(because("pick.too_wide"), check="grasp")
    return found


def _configuration_above(arm: MovingArm, tool: Point, yaw: float | None) -> Mapping[str, float]:
    above = (tool[0], tool[1], tool[2] + APPROACH)
    if len(arm.joint_names) < FULL:
        return arm.ik(position=above)[0]
    if yaw is not None:
        return arm.ik(pose=Pose(above, looking_down(yaw)))[0]
    return arm.ik(position=above, along=DOWN)[0]


def _yaw_at(arm: MovingArm, place: Place, seen: Seen, way: Approach) -> float | None:
    """[rad] of the jaws at a place where the thing's turn matters; None where it does not."""
    if not isinstance(place, PosePlace) or place.yaw is None:
        return None
    if len(arm.joint_names) < FULL:
        raise Refused(because("pick.cannot_turn", robot=arm.name, place=place.name), check="orientation")
    return place.yaw + yaw_of(arm.fk(way.above).orientation) - yaw_of(seen.pose.orientation)


def _spot(eyes: Eyes, place: Place, camera: str) -> Point:
    """Where [m] the point between the jaws lets go; a tag that marks it is looked for."""
    if isinstance(place, PosePlace):
        return place.position
    seen = eyes.one(place.name, camera)
    return compose((seen.pose.position, seen.pose.orientation), (place.offset, IDENTITY[1]))[0]


def _take(hand: Hand, thing: Thing, seen: Seen, way: Approach) -> bool:
    """True if the jaws have closed on something; the tool is above again in either case."""
    hand.grip("open")
    hand.tell(because("pick.above"))
    hand.move(way.above)
    with _touching(hand.arm, thing.name):
        hand.go_straight(-APPROACH)
        _turn_with_the_jaws(hand.arm, thing, seen, way)
        gripped = hand.grip("close")
        hand.tell(because("pick.gripper", gripped.summary))
        hand.go_straight(APPROACH)
    if gripped.held != thing.name:
        hand.grip("open")
        return False
    return True


def _turn_with_the_jaws(arm: MovingArm, thing: Thing, seen: Seen, way: Approach) -> None:
    """What closing jaws do to a thing that stands askew between them."""
    _, center = body_of(thing)
    pose = (seen.pose.position, from_axis_angle((0.0, 0.0, 1.0), yaw_of(seen.pose.orientation) + way.turned))
    grasp = grasp_point(thing, seen)
    local = compose(pose, (thing.grasp_offset, IDENTITY[1]))[0]
    shifted: Point = (pose[0][0] + grasp[0] - local[0], pose[0][1] + grasp[1] - local[1], pose[0][2])
    at, turn = compose((shifted, pose[1]), center)
    arm.scene.move(thing.name, at, turn)


def _put(hand: Hand, name: str, release: Mapping[str, float]) -> None:
    """Carries it, lets it go, and rises; what fails with the thing between the jaws says so."""
    try:
        hand.tell(because("pick.carrying"))
        hand.move(release)
        with _touching(hand.arm, name):
            hand.go_straight(-APPROACH)
            hand.tell(because("pick.gripper", hand.grip("open").summary))
            hand.go_straight(APPROACH)
    except (Refused, Canceled) as error:
        held = hand.arm.scene.objects.get(name)
        if held is None or not held.attached:
            raise
        said = because("pick.between_the_jaws", error.message, thing=name)
        raise (Canceled(said, error.status) if isinstance(error, Canceled) else Aborted(said)) from error


@contextmanager
def _touching(arm: MovingArm, name: str) -> Iterator[None]:
    """The thing may touch what it stands on, and the jaws, until the block ends."""
    arm.scene.allow(name, "*")
    try:
        yield
    finally:
        arm.scene.disallow(name, "*")
