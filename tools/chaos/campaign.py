"""Faults in a seeded order, each in the middle of a move, and what came of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from random import Random
from typing import Any

import msgspec

import gemelo
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.tools.chaos.causes import cause_of
from gemelo.tools.chaos.faults import BYSTANDERS, FAULTS, READY, Fault
from gemelo.tools.chaos.invariants import is_starved, jerks, jumps, misses, moved, segments
from gemelo.tools.chaos.person import quietly_cancel
from gemelo.tools.chaos.site import ChaosSite
from gemelo.tools.chaos.slots import steps_in
from gemelo.tools.chaos.slots import violations as slot_violations
from gemelo.tools.stack.stack import StackError

TO_END = 25.0  # [s] beyond the move's own time in which its client must know its end
TO_BEGIN = 5.0  # [s] for a move to get under way
MUTED = 2.0  # [s] after such a fault until everything is recorded again


class Episode(msgspec.Struct, frozen=True, kw_only=True):
    """One fault in one move."""

    number: int
    fault: str
    chosen: str  # what of the fault was random
    ended: str  # how the client was told that the move ended
    reason: str = ""  # that it was given, where it did not succeed
    to_end: float = 0.0  # [s] from the fault to the client's knowledge
    to_ready: float = 0.0  # [s] from the heal until every process is ready
    hands: tuple[str, ...] = ()  # what a person had to do
    was_late: bool = False  # the machine gave the virtual device no time: whether its shaft arrived was not judged
    slots: int = 0  # of 1 ms in which a joint made a step, each held against the limits
    violations: tuple[str, ...] = ()
    why: tuple[Reason, ...] = ()  # the same as data


def order(seed: int, faults: Sequence[Fault] = FAULTS) -> Iterator[tuple[int, Fault, Random]]:
    """Number, fault and source of chance of every episode: all faults once in random order, then again.

    An episode's chance depends on seed and number alone, so that one can be repeated by itself.
    """
    bag: list[Fault] = []
    number, shuffler = 0, Random(f"{seed}")
    while True:
        if not bag:
            bag = list(faults)
            shuffler.shuffle(bag)
        yield number, bag.pop(), Random(f"{seed} {number}")
        number += 1


class Campaign:
    """Carries out episodes on a site, one after the other."""

    def __init__(self, site: ChaosSite, say: Callable[[str], object]) -> None:
        self.person = site.person
        self.muted: list[tuple[int, int]] = []  # [ns] UNIX, from and to when records may be lost
        self._site, self._say = site, say
        self._config = device_config(site.arm.description)

    def episode(self, number: int, fault: Fault, random: Random) -> Episode:
        """One move with one fault; never raises for what the stack does."""
        person, violations = self.person, list[Reason]()
        self._use_wire(fault, violations)
        if (unready := person.make_ready(READY, reference=False)) is not None:
            violations.append(because("chaos.not_ready", unready))
        person.forget()
        late_before = len(person.late)
        motion = self._start(random, violations)
        if motion is None:
            return Episode(number=number, fault=fault.name, chosen="", ended="not begun", **_both(violations))
        self._site.motion = motion
        self._site.slots.forget()  # a reference before the move has set the counters
        self._reach(motion, random.uniform(0.1, 0.8))
        begun_at, begun = time.monotonic(), time.time_ns()
        chosen = self._begin(fault, random, violations)
        person.pause(random.uniform(*fault.lasts))
        self._heal(fault, violations)
        healed = time.monotonic()
        ended, why = self._end(motion, begun_at)
        to_end = time.monotonic() - begun_at
        if ended == "unknown":
            violations.append(because("chaos.no_end", time=TO_END))
        violations += meddled(fault, ended, why) + self._site.take_found()
        to_ready = self._await_ready(healed, violations)
        if fault.mutes:
            self.muted.append((begun - int(MUTED * 1e9), time.time_ns() + int(MUTED * 1e9)))
        violations += self._judge(motion, ended, fault, late_before)
        slots, beyond = self._judge_slots(fault)
        if beyond:
            self._site.slots.keep_as(self._site.stack.out / f"episode_{number}.slots")
        violations += beyond
        was_late = len(person.late) > late_before  # a shaft that stops from full speed has lost steps
        person.hands.clear()
        if (unready := person.make_ready(READY, reference=fault.slips or was_late)) is not None:
            violations.append(because("chaos.not_ready.again", unready))
        violations += unexpected_hands(fault, person.hands, was_late)
        return Episode(
            number=number, fault=fault.name, chosen=chosen, ended=ended, reason=str(why or ""), to_end=to_end,
            to_ready=to_ready, hands=tuple(person.hands), was_late=was_late, slots=slots, **_both(violations),
        )  # fmt: skip

    def _start(self, random: Random, violations: list[Reason]) -> gemelo.Motion | None:
        end, why = time.monotonic() + READY, because("chaos.untried")
        while time.monotonic() < end:
            try:
                return self.person.start(random)
            except gemelo.Error as refused:
                why = cause_of(refused)
                self.person.pause(0.2)
                self.person.make_ready(1.0, reference=False)
        violations.append(because("chaos.no_move", why, time=READY))
        return None

    def _reach(self, motion: gemelo.Motion, share: float) -> None:
        self._site.arm.wait_for(lambda: motion.is_over or motion.progress > share, TO_BEGIN + motion.plan.duration)

    def _begin(self, fault: Fault, random: Random, violations: list[Reason]) -> str:
        try:
            return fault.begin(self._site, random)
        except (gemelo.Error, StackError, OSError) as error:
            violations.append(because("chaos.not_begun", cause_of(error)))
            return ""

    def _heal(self, fault: Fault, violations: list[Reason]) -> None:
        """The hand that heals a device may come when its link is not back yet."""
        end = time.monotonic() + READY
        while time.monotonic() < end:
            try:
                return fault.heal(self._site)
            except gemelo.Error:
                self.person.pause(0.1)
            except (StackError, OSError) as error:
                violations.append(because("chaos.not_healed", cause_of(error)))
                return None
        return None

    def _use_wire(self, fault: Fault, violations: list[Reason]) -> None:
        try:
            self._site.use_wire(fault.wire)
        except (StackError, OSError) as error:
            violations.append(because("chaos.no_wire", cause_of(error), wire=str(fault.wire)))

    def _end(self, motion: gemelo.Motion, begun_at: float) -> tuple[str, Reason | None]:
        left = motion.plan.duration + TO_END - (time.monotonic() - begun_at)
        try:
            motion.wait(max(left, 1.0))
        except gemelo.Aborted as error:
            return error.status.name.lower(), error.message
        except gemelo.Lost as error:
            return "lost", error.message
        except TimeoutError:
            quietly_cancel(motion)
            return "unknown", None
        return motion.status.name.lower(), None

    def _await_ready(self, healed: float, violations: list[Reason]) -> float:
        try:
            self._site.stack.wait_ready(READY)
        except StackError as error:
            violations += words_of(error)
        return time.monotonic() - healed

    def _judge(self, motion: gemelo.Motion, ended: str, fault: Fault, late_before: int) -> list[Reason]:
        """Jumps, false successes and motion that nobody asked for.

        Where the machine gave the virtual device no time while it moved, its motors stopped from full speed and lost
        steps, as real ones would: the device has said so, and the shaft is not held against the goal.
        """
        person, arm = self.person, self._site.arm.description
        if not person.await_rest():
            return [because("chaos.no_rest")]
        at_rest, found = person.position, list[Reason]()
        for segment in segments(person.states, person.late):
            found += jumps(arm, segment)
            found += [] if fault.trips else jerks(arm, segment)  # drivers that go off let the counters stop at once
        if ended == "succeeded":
            result = motion.result
            if result.executed_steps != result.commanded_steps:
                done, commanded = result.executed_steps, result.commanded_steps
                found.append(because("chaos.not_all_steps", executed=done, commanded=commanded))
            if not fault.slips and len(person.late) == late_before:
                found += misses(arm, motion.plan.trajectory.points[-1].positions, person.shaft())
        person.pause(0.5)
        return found + moved(arm, at_rest, person.position)

    def _judge_slots(self, fault: Fault) -> tuple[int, list[Reason]]:
        """In how many slots there was a step, and what of them was beyond the limits of velocity or acceleration."""
        rows = self._site.slots.rows()
        return steps_in(rows), slot_violations(self._config, rows, may_stop_at_once=fault.trips)


def words_of(error: StackError) -> list[Reason]:
    """What a report says of a stack that is not ready: the names, then a line for each process with its reason."""
    return [plain(str(error).partition("\n")[0]), *(plain(each.sentence) for each in error.unready)]


def meddled(fault: Fault, ended: str, why: Reason | None) -> list[Reason]:
    """That a process which takes no part in a move, as docs/inside/failures.md has it, had to do with its end."""
    if fault.of not in BYSTANDERS or ended == "succeeded" or is_starved(why):
        return []
    return [because("chaos.meddled", why or because("ended.unexplained"), process=fault.of, ended=ended)]


def unexpected_hands(fault: Fault, hands: Sequence[str], was_late: bool = False) -> list[Reason]:
    """What a person had to do although the fault does not ask for it."""
    allowed = {"stop"}
    if fault.boots or fault.trips or fault.slips:
        allowed |= {"reference", "arm"}
    if fault.trips or fault.slips:
        allowed |= {"reset"}
    if was_late:
        allowed |= {"reference"}
    return [because("chaos.hand", hand=word) for word in hands if word not in allowed]


def _both(violations: Sequence[Reason]) -> dict[str, Any]:
    """The two fields of an episode."""
    return {"violations": tuple(map(str, violations)), "why": tuple(violations)}
