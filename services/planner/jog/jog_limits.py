"""The limits that slow a jogged arm: the thing, its value, and the limit."""

from __future__ import annotations

from msgspec.structs import replace

from gemelo.libraries.arm.kinematics.self_collisions import LinkPair
from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.planning import JogLimit
from gemelo.schemas.reasons import Reason, because


def worded(limit: JogLimit) -> JogLimit:
    """With its English sentence, which is made where it is published: a jog has a new limit fifty times a second."""
    return replace(limit, message=str(limit.why or ""))


def collision(names: LinkPair, distance: float, clearance: float) -> JogLimit:
    """`distance` [m] between the two now; they keep the `clearance` [m], or may only come away."""
    first, second = names
    check = "contact"
    if distance >= clearance:
        check = "collision"
        why = because("jog.limit.collision", first=first, second=second, distance=distance, limit=clearance)
    elif distance > 0.0:
        why = because("jog.limit.contact", first=first, second=second, distance=distance)
    else:
        why = because("jog.limit.inside", first=first, second=second, depth=-distance)
    return JogLimit(check=check, subject=" and ".join(names), value=distance, limit=clearance, why=why)


def joint_limit(joint: Joint, position: float, velocity: float) -> JogLimit:
    """Of a joint [rad] or [m] on its way to the limit that lies in the direction of `velocity`."""
    limit = joint.upper if velocity > 0.0 else joint.lower
    code = "jog.limit.turning" if joint.unit == "rad" else "jog.limit.sliding"
    why = because(code, joint=joint.name, limit=limit)
    return JogLimit(check="joint limit", subject=joint.name, value=position, limit=limit, why=why)


def singularity(share: float) -> JogLimit:
    """`share` of the manipulability at which slowing begins."""
    why = because("jog.limit.singular", share=share)
    return JogLimit(check="singularity", subject="tool", value=share, limit=1.0, why=why)


def speed_limit(joint: Joint, wanted: float) -> JogLimit:
    """A joint is asked for more [rad/s] or [m/s] than it can."""
    fastest = joint.velocity
    why = because("jog.speed.turning" if joint.unit == "rad" else "jog.speed.sliding", joint=joint.name, limit=fastest)
    return JogLimit(check="speed limit", subject=joint.name, value=wanted, limit=fastest, why=why)


def no_command(why: Reason) -> JogLimit:
    """What the command asks for and cannot have."""
    return JogLimit(check="command", why=why)
