"""The time cache of one frame, its poses in the parent frame over time, as tf2's TimeCache; and the errors of a
look-up, one class per reason."""

from __future__ import annotations

from bisect import bisect_left

from gemelo.libraries.arm.frames.transforms import Rigid, interpolate
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import because

_TRIM = 64  # samples that may be too old before they are cut off together


class FrameError(ReasonedError, LookupError):
    """A look-up that cannot be answered."""


class UnknownFrameError(FrameError):
    """No transform ever named this frame."""


class UnconnectedError(FrameError):
    """Both frames are known, but no chain of transforms joins them."""


class PastError(FrameError):
    """The time asked for is before the oldest sample that is kept."""


class FutureError(FrameError):
    """The time asked for is after the newest sample; nothing is extrapolated."""


class SingleSampleError(FrameError):
    """There is one sample, at another time: nothing to interpolate between."""


class WaitTimeout(FrameError):
    """The frame did not become available in time; `__cause__` is the last reason."""


def seconds(stamp: int) -> str:
    """[ns] UNIX as seconds with nine digits; 0 is the latest."""
    return "the latest" if stamp == 0 else f"{stamp // 1_000_000_000}.{stamp % 1_000_000_000:09d} s"


class TimeCache:
    """The samples of one child in its parent, oldest first; a static one has a single, timeless sample."""

    __slots__ = ("child", "is_static", "parent", "poses", "stamps")

    def __init__(self, parent: str, child: str, is_static: bool) -> None:
        self.parent, self.child, self.is_static = parent, child, is_static
        self.stamps: list[int] = []
        self.poses: list[Rigid] = []

    def insert(self, stamp: int, pose: Rigid, window: int) -> bool:
        """Insert the pose ([m], quaternion) at `stamp` [ns]; False where it is older than `window` [ns]."""
        stamps = self.stamps
        if not stamps or stamp > stamps[-1]:
            stamps.append(stamp)
            self.poses.append(pose)
            self._trim(stamp - window)
            return True
        if stamp < stamps[-1] - window:
            return False
        index = bisect_left(stamps, stamp)
        if stamps[index] == stamp:
            self.poses[index] = pose
        else:
            stamps.insert(index, stamp)
            self.poses.insert(index, pose)
        return True

    def _trim(self, oldest: int) -> None:
        if len(self.stamps) > _TRIM and self.stamps[_TRIM] < oldest:
            index = bisect_left(self.stamps, oldest)
            del self.stamps[:index], self.poses[:index]

    def oldest(self, window: int) -> int:
        """The oldest sample's time [ns] that is within the window."""
        return self.stamps[bisect_left(self.stamps, self.stamps[-1] - window)]

    def at(self, stamp: int, window: int) -> Rigid:
        """The pose at `stamp` [ns]; raises what is true of that time."""
        stamps = self.stamps
        if self.is_static or stamp == stamps[-1]:
            return self.poses[-1]
        if stamp > stamps[-1]:
            raise self._outside(FutureError, stamp, "frame.after_newest", stamps[-1])
        if stamp < stamps[-1] - window:
            raise self._outside(PastError, stamp, "frame.before_oldest", self.oldest(window))
        index = bisect_left(stamps, stamp)
        if stamps[index] == stamp:
            return self.poses[index]
        if index == 0 or stamps[index - 1] < stamps[-1] - window:
            raise self._outside(PastError, stamp, "frame.before_oldest", stamps[index])
        before = stamps[index - 1]
        share = (stamp - before) / (stamps[index] - before)
        return interpolate(self.poses[index - 1], self.poses[index], share)

    def _outside(self, kind: type[FrameError], stamp: int, code: str, bound: int) -> FrameError:
        where = {"parent": self.parent, "child": self.child, "time": seconds(stamp), "bound": seconds(bound)}
        if len(self.stamps) == 1:
            return SingleSampleError(because("frame.single", **where))
        return kind(because(code, off=abs(stamp - bound) / 1e9, **where))
