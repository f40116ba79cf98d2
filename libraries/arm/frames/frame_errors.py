"""The errors of a frame look-up: one class per reason, and every text has the times."""

from __future__ import annotations


class FrameError(LookupError):
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
