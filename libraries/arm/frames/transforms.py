"""Rigid transforms on plain tuples: translation (x, y, z) [m] and unit quaternion (x, y, z, w). No numpy: 1 us each."""

from __future__ import annotations

import math

from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.frames import Transform
from gemelo.schemas.reasons import because

Point = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Rigid = tuple[Point, Quaternion]

IDENTITY: Rigid = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
_RIGHT_ANGLE = 1e-8  # cosine of a pitch below which roll and yaw are one to rounding
_NEARLY_PARALLEL = 1.0 - 1e-9  # cosine above which slerp is linear to rounding


class BadTransform(ReasonedError, ValueError):
    """A message that is no transform; the reason says what of it."""


def rotate(rotation: Quaternion, point: Point) -> Point:
    """The point [m] rotated by the unit quaternion: v + 2 w (q x v) + 2 q x (q x v)."""
    x, y, z, w = rotation
    a, b, c = point
    u, v, t = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return a + w * u + y * t - z * v, b + w * v + z * u - x * t, c + w * t + x * v - y * u


def multiply(first: Quaternion, second: Quaternion) -> Quaternion:
    """Hamilton product of unit quaternions (x, y, z, w): the rotation `second`, then `first`."""
    x, y, z, w = first
    a, b, c, d = second
    return (
        w * a + x * d + y * c - z * b,
        w * b - x * c + y * d + z * a,
        w * c + x * b - y * a + z * d,
        w * d - x * a - y * b - z * c,
    )


def compose(outer: Rigid, inner: Rigid) -> Rigid:
    """a_T_c of a_T_b and b_T_c; translations in [m], unit quaternions."""
    (ox, oy, oz), rotation = outer
    px, py, pz = rotate(rotation, inner[0])
    return (ox + px, oy + py, oz + pz), multiply(rotation, inner[1])


def inverse(transform: Rigid) -> Rigid:
    """b_T_a of a_T_b; translation in [m], unit quaternion."""
    x, y, z, w = transform[1]
    back = (-x, -y, -z, w)
    px, py, pz = rotate(back, transform[0])
    return (-px, -py, -pz), back


def slerp(first: Quaternion, second: Quaternion, share: float) -> Quaternion:
    """The rotation at `share` in [0, 1] of the shorter way from `first` to `second` (Shoemake 1985)."""
    x, y, z, w = first
    a, b, c, d = second
    cosine = x * a + y * b + z * c + w * d
    if cosine < 0.0:
        a, b, c, d, cosine = -a, -b, -c, -d, -cosine
    if cosine > _NEARLY_PARALLEL:
        p, q = 1.0 - share, share
    else:
        angle = math.acos(cosine)
        sine = math.sin(angle)
        p, q = math.sin((1.0 - share) * angle) / sine, math.sin(share * angle) / sine
    return p * x + q * a, p * y + q * b, p * z + q * c, p * w + q * d


def interpolate(first: Rigid, second: Rigid, share: float) -> Rigid:
    """Interpolates at `share` in [0, 1]: linear in translation [m], slerp in rotation."""
    (x, y, z), (a, b, c) = first[0], second[0]
    point = (x + share * (a - x), y + share * (b - y), z + share * (c - z))
    return point, slerp(first[1], second[1], share)


def from_rpy(roll: float, pitch: float, yaw: float) -> Quaternion:
    """URDF's fixed-axis roll, pitch, yaw [rad] as a quaternion."""
    sr, cr = math.sin(roll / 2.0), math.cos(roll / 2.0)
    sp, cp = math.sin(pitch / 2.0), math.cos(pitch / 2.0)
    sy, cy = math.sin(yaw / 2.0), math.cos(yaw / 2.0)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def to_rpy(rotation: Quaternion) -> Point:
    """Roll, pitch and yaw [rad] of a unit quaternion, as of `from_rpy`; the roll is 0 where pitch is a right angle."""
    x, y, z, w = rotation
    sine, up, ahead = 2.0 * (w * y - z * x), 2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)
    cosine = math.hypot(up, ahead)
    pitch = math.atan2(sine, cosine)
    if cosine < _RIGHT_ANGLE:  # roll and yaw turn about one axis: what is left of `up` and `ahead` is rounding
        return 0.0, pitch, math.atan2(2.0 * (w * z - x * y), 1.0 - 2.0 * (x * x + z * z))
    return math.atan2(up, ahead), pitch, math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def from_axis_angle(axis: Point, angle: float) -> Quaternion:
    """A turn by `angle` [rad] about a unit axis."""
    sine = math.sin(angle / 2.0)
    return axis[0] * sine, axis[1] * sine, axis[2] * sine, math.cos(angle / 2.0)


def to_message(rigid: Rigid) -> Transform:
    """The message of the transform ([m], quaternion)."""
    return Transform(translation=rigid[0], rotation=rigid[1])


def from_message(transform: Transform) -> Rigid:
    """The transform as tuples, its quaternion of length one; raises `BadTransform` where it is none."""
    translation, rotation = transform.translation, transform.rotation
    if len(translation) != 3 or len(rotation) != 4:
        raise BadTransform(because("transform.numbers", translation=len(translation), rotation=len(rotation)))
    x, y, z, w = rotation
    length = math.sqrt(x * x + y * y + z * z + w * w)
    if abs(length - 1.0) > 1e-3:
        raise BadTransform(because("transform.quaternion", rotation=rotation, length=length))
    px, py, pz = translation
    return (px, py, pz), (x / length, y / length, z / length, w / length)
