"""The checks of an arm that is wired for the first time: drivers, switches, and each joint by itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import gemelo
from gemelo.schemas.device_config import InputRole
from gemelo.schemas.reasons import Reason, because
from gemelo.tools.cli.common.units import show
from gemelo.tools.cli.device.selftest_person import Answer, Outcome, Person

if TYPE_CHECKING:
    from gemelo import Arm
    from gemelo.libraries.arm.model.description import Joint
    from gemelo.schemas.robot import Input

SEEN_WITHIN = 2.0  # [s] chosen: from a switch to the device's state at this end
ONE_DEGREE = {"rad": 0.017453292519943295, "m": 0.001}  # one degree, or one millimetre
RAMPS = 2.0  # chosen: times the way of both ramps without a limit of jerk, so that full speed is reached with one
MARGIN = 0.05  # chosen: share of a joint's travel that the ramp keeps from its end
RECOVERABLE = (gemelo.DeviceMode.FAULT, gemelo.DeviceMode.ESTOP)


def drivers(arm: Arm, person: Person) -> Iterator[Outcome]:
    """Without current, then with it."""
    arm.device.disarm()
    off = person.ask(because("selftest.ask.off"), (Answer.YES, Answer.NO))
    yield outcome(because("selftest.check.off"), off, because("selftest.drivers.on_always"))
    arm.device.arm()
    on = person.ask(because("selftest.ask.on"), (Answer.YES, Answer.NO))
    yield outcome(because("selftest.check.on"), on, because("selftest.drivers.off_always"))


def switches(arm: Arm, person: Person) -> Iterator[Outcome]:
    """Each input, pressed by hand and let go; what that has stopped is led back to rest."""
    for each in arm.description.inputs:
        yield switch(arm, each, person)
        recover(arm)


def switch(arm: Arm, each: Input, person: Person) -> Outcome:
    """One input."""
    check = because("selftest.check.input", input=each.name)
    wiring = because("selftest.input.wiring", input=each.name, pin=each.pin)
    if arm.inputs[each.name] and each.role is not InputRole.ESTOP:
        person.say(because("selftest.input.active", input=each.name))
        return Outcome(check, Answer.NO, wiring)
    if person.ask(because("selftest.ask.press", input=each.name, pin=each.pin), (Answer.YES,)) is Answer.SKIP:
        return Outcome(check, Answer.SKIP)
    is_seen = arm.wait_for(lambda: arm.inputs[each.name], SEEN_WITHIN)
    person.say(because("selftest.input.seen") if is_seen else because("selftest.input.unseen", input=each.name))
    person.ask(because("selftest.ask.release", input=each.name), (Answer.YES,))
    is_released = arm.wait_for(lambda: not arm.inputs[each.name], SEEN_WITHIN)
    return Outcome(check, Answer.YES) if is_seen and is_released else Outcome(check, Answer.NO, wiring)


def stand(arm: Arm, person: Person) -> bool:
    """True once the arm's place is known: declared, where the device does not know it."""
    recover(arm)
    if all(arm.device.state.referenced):
        return True
    places = zip(arm.description.joints, arm.description.reference_position, strict=True)
    pose = ", ".join(f"{joint.name} {show(at, joint.unit)}" for joint, at in places)
    if person.ask(because("selftest.ask.reference", pose=pose), (Answer.YES,)) is Answer.SKIP:
        return False
    arm.reference()
    return True


def joint(arm: Arm, each: Joint, person: Person) -> Iterator[Outcome]:
    """One step, one degree, a ramp to full speed; a joint that goes the wrong way, or not, gets no further."""
    for check in (one_step, one_degree, ramp):
        made = check(arm, each, person)
        yield made
        if not made.is_well:
            return


def one_step(arm: Arm, each: Joint, person: Person) -> Outcome:
    """One step there and back."""
    check, before = because("selftest.check.step", joint=each.name), arm.joints[each.name]
    size = inwards(each, before, abs(1.0 / each.steps.per_unit))
    if (refusal := go(arm, each, before + size, before)) is not None:
        return Outcome(check, Answer.NO, refusal)
    question = because("selftest.ask.step", joint=each.name, size=show(abs(size), each.unit, 4))
    return outcome(check, person.ask(question, (Answer.YES, Answer.NO, Answer.HUMS)), still(each))


def one_degree(arm: Arm, each: Joint, person: Person) -> Outcome:
    """One degree or millimetre, to where its numbers grow if there is room, and back after the answer."""
    check, before = because("selftest.check.direction", joint=each.name), arm.joints[each.name]
    by = inwards(each, before, ONE_DEGREE[each.unit])
    if (refusal := go(arm, each, before + by)) is not None:
        return Outcome(check, Answer.NO, refusal)
    side = "upper" if by > 0.0 else "lower"
    question = because("selftest.ask.direction", joint=each.name, by=show(by, each.unit), side=side)
    answer = person.ask(question, (Answer.YES, Answer.WRONG_WAY, Answer.HUMS, Answer.NO))
    go(arm, each, before)
    if answer is Answer.WRONG_WAY:
        return Outcome(check, answer, because("selftest.joint.wrong_way", joint=each.name))
    return outcome(check, answer, still(each))


def ramp(arm: Arm, each: Joint, person: Person) -> Outcome:
    """To full speed and back to rest, there and back; by less where the joint or what stands around it has less."""
    check, before = because("selftest.check.ramp", joint=each.name), arm.joints[each.name]
    refusal, fastest = None, 0.0

    def watch(_: object) -> None:
        nonlocal fastest
        fastest = max(fastest, abs(arm.velocities[each.name]))

    for to in ways(each, before):
        if (refusal := go(arm, each, to, before, watch=watch)) is None:
            question = because(
                "selftest.ask.ramp", joint=each.name, distance=show(abs(to - before), each.unit),
                speed=f"{show(fastest, each.unit)}/s",
            )  # fmt: skip
            answer = person.ask(question, (Answer.YES, Answer.HUMS, Answer.LOST_STEPS))
            return outcome(check, answer, because("selftest.joint.too_fast", joint=each.name))
    return Outcome(check, Answer.NO, refusal)


def go(arm: Arm, each: Joint, *places: float, watch: Callable[[object], None] | None = None) -> Reason | None:
    """Moves the joint to each place in turn, the others stand; why not, where that is refused or ends too early.

    `watch` is called while it moves. The places are [rad] or [m].
    """
    try:
        for place in places:
            arm.execute(arm.plan(joints={each.name: place}), on_progress=watch)
    except (gemelo.Refused, gemelo.Aborted) as error:
        return error.reason
    return None


def ways(each: Joint, before: float) -> tuple[float, ...]:
    """Where the ramp may go, the best first: full speed to the roomier side, the other, then half as far.

    `before` [rad] or [m] is where the joint stands; those places are in the same unit.
    """
    whole = RAMPS * each.velocity**2 / each.acceleration
    keep = MARGIN * (each.upper - each.lower)
    up, down = each.upper - keep - before, before - each.lower - keep
    sides = sorted(((up, 1.0), (down, -1.0)), reverse=True)
    places = [before + sign * min(whole, room) * share for share in (1.0, 0.5) for room, sign in sides if room > 0.0]
    return tuple(places)


def inwards(each: Joint, at: float, by: float) -> float:
    """`by`, or as much to the other side where the joint's end is nearer; [rad] or [m], as `at`."""
    return by if at + by <= each.upper else -by


def recover(arm: Arm) -> None:
    """Leads back from the emergency stop or fault that a pressed switch has made, with current."""
    if arm.device.mode in RECOVERABLE:
        arm.device.reset()
    if not arm.device.state.armed:
        arm.device.arm()


def still(each: Joint) -> Reason:
    """What to look at where a joint hums or stands still."""
    pin = each.drive.motor.step_pin
    return because("selftest.joint.still", joint=each.name, pin=-1 if pin is None else pin)


def outcome(check: Reason, answer: Answer, remedy: Reason) -> Outcome:
    """With the remedy where it did not go as it should."""
    made = Outcome(check, answer, remedy)
    return made._replace(remedy=None) if made.is_well else made
