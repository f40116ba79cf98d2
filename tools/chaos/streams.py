"""Streams of targets that die, stall, are sent again or come from two clients: the arm rests soon after the last."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from random import Random

import gemelo
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import JOINT_TARGETS
from gemelo.tools.chaos.site import ChaosSite

PERIOD = 0.03  # [s] between two targets
LASTS = (0.6, 1.6)  # [s] from a stream's first target to its last
BURSTS, GAP = (3, 8), (0.05, 0.4)  # how many, and [s] without a target between two: shorter than what ends a stream
SWING, CYCLE = 0.05, 2.0  # of the first joint's travel, and [s] there and back
STOPPED = 3.0  # [s] from a stop to rest, on a busy machine
RESTS = 4.0  # [s] from the last target to rest: 0.11 s and the slowest stop, on a busy machine
UNLIMITED = math.tau  # [rad] the travel of a joint without an end

Say = Callable[[ChaosSite, JointTargets], None]


def dying_stream(site: ChaosSite, random: Random) -> str:
    """No target follows the last one, at any point of the way."""
    _ready(site)
    count = _say_for(site, random.uniform(*LASTS))
    expect_rest(site)
    return f"a stream that dies after {count} targets"


def stalling_stream(site: ChaosSite, random: Random) -> str:
    """Targets come in bursts: the arm brakes in between, and goes on."""
    _ready(site)
    bursts = random.randint(*BURSTS)
    for _ in range(bursts):
        _say_for(site, random.uniform(*LASTS) / bursts)
        site.pause(random.uniform(*GAP))
    expect_rest(site)
    return f"a stream of {bursts} bursts"


def replayed_stream(site: ChaosSite, random: Random) -> str:
    """Beside each target an older one is sent again, with its stamp of then."""
    _ready(site)
    said: list[JointTargets] = []

    def say(site: ChaosSite, target: JointTargets) -> None:
        said.append(target)
        _own(site, target)
        _own(site, random.choice(said))

    count = _say_for(site, random.uniform(*LASTS), say)
    expect_rest(site)
    return f"a stream of {count} targets, and older ones between them"


def stream_of_two(site: ChaosSite, random: Random) -> str:
    """A stranger streams too, each target as far on the other side."""
    _ready(site)
    home = dict(site.arm.joints)

    def say(site: ChaosSite, target: JointTargets) -> None:
        _own(site, target)
        mirrored = [2.0 * home[name] - place for name, place in zip(target.name, target.position, strict=True)]
        site.bus.publish(JOINT_TARGETS, JointTargets(stamp=target.stamp, name=target.name, position=tuple(mirrored)))

    count = _say_for(site, random.uniform(*LASTS), say)
    expect_rest(site)
    return f"two streams of {count} targets each"


def expect_rest(site: ChaosSite) -> None:
    """Notes an arm that does not come to rest by itself."""
    if not site.stands_within(RESTS):
        site.found.append(because("chaos.stream.moves", time=RESTS))


def _ready(site: ChaosSite) -> None:
    """At rest, without the move that was under way."""
    site.arm.stop()
    site.stands_within(STOPPED)


def _own(site: ChaosSite, target: JointTargets) -> None:
    site.arm.node.publisher(JOINT_TARGETS).put(target)


def _say_for(site: ChaosSite, seconds: float, say: Say = _own) -> int:
    """How many targets were sent in `seconds` [s]: the first joint swings from where it stands."""
    joint = site.arm.description.joints[0]
    begin = site.arm.joints[joint.name]
    travel = joint.upper - joint.lower if math.isfinite(joint.upper - joint.lower) else UNLIMITED
    inwards = -1.0 if math.isfinite(joint.upper) and begin > 0.5 * (joint.lower + joint.upper) else 1.0
    count = max(2, round(seconds / PERIOD))
    for index in range(count):
        share = 0.5 - 0.5 * math.cos(math.tau * index * PERIOD / CYCLE)
        target = begin + inwards * SWING * travel * share
        with suppress(gemelo.Error):  # of an arm that somebody else has stopped
            say(site, JointTargets(stamp=site.arm.node.now(), name=(joint.name,), position=(target,)))
        site.pause(PERIOD)
    return count
