"""The limits that slow a jogged arm, in words: the thing, its value, and the limit."""

from __future__ import annotations

import math

from gemelo.libraries.arm.kinematics.self_collisions import LinkPair
from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.planning import JogLimit


def collision(names: LinkPair, distance: float, clearance: float) -> JogLimit:
    """`distance` [m] between the two now; they keep the `clearance` [m], or may only come away."""
    subject = " and ".join(names)
    if distance >= clearance:
        said = f"collision of {subject} ({_mm(distance)} apart, {1e3 * clearance:g} mm stay free)"
        return JogLimit(check="collision", subject=subject, value=distance, limit=clearance, message=said)
    how = f"{_mm(distance)} apart" if distance > 0.0 else f"{_mm(-distance)} inside one another"
    said = f"contact of {subject} ({how}: they may only come away, slowly)"
    return JogLimit(check="contact", subject=subject, value=distance, limit=clearance, message=said)


def joint_limit(joint: Joint, position: float, velocity: float) -> JogLimit:
    """Of a joint [rad] or [m] on its way to the limit that lies in the direction of `velocity`."""
    limit = joint.upper if velocity > 0.0 else joint.lower
    shown = f"{math.degrees(limit):.1f} deg" if joint.unit == "rad" else _mm(limit)
    said = f"joint limit of {joint.name} ({shown})"
    return JogLimit(check="joint limit", subject=joint.name, value=position, limit=limit, message=said)


def singularity(share: float) -> JogLimit:
    """`share` of the manipulability at which slowing begins."""
    said = f"singularity (manipulability at {100.0 * share:.0f} % of where slowing begins)"
    return JogLimit(check="singularity", subject="tool", value=share, limit=1.0, message=said)


def speed_limit(joint: Joint, wanted: float) -> JogLimit:
    """A joint is asked for more [rad/s] or [m/s] than it can."""
    fastest = joint.velocity
    shown = f"{math.degrees(fastest):.0f} deg/s" if joint.unit == "rad" else f"{1e3 * fastest:.0f} mm/s"
    said = f"speed limit of {joint.name} ({shown})"
    return JogLimit(check="speed limit", subject=joint.name, value=wanted, limit=fastest, message=said)


def no_command(message: str) -> JogLimit:
    """What the command asks for and cannot have."""
    return JogLimit(check="command", message=message)


def _mm(value: float) -> str:
    return f"{1e3 * value:.1f} mm"
