"""The frame buffer of the last ten seconds: as tf2's Buffer, but `wait` is notified and does not poll."""

from __future__ import annotations

import time
from threading import Condition

from gemelo.libraries.arm.errors import nearest
from gemelo.libraries.arm.frames.time_cache import (
    FrameError,
    FutureError,
    PastError,
    SingleSampleError,
    TimeCache,
    UnconnectedError,
    UnknownFrameError,
    WaitTimeout,
    seconds,
)
from gemelo.libraries.arm.frames.transforms import IDENTITY, Rigid, compose, from_message, inverse, to_message
from gemelo.schemas.frames import FrameTransform, FrameTransforms, Transform
from gemelo.schemas.reasons import Reason, because

__all__ = [
    "FrameBuffer",
    "FrameError",
    "FutureError",
    "PastError",
    "SingleSampleError",
    "UnconnectedError",
    "UnknownFrameError",
    "WaitTimeout",
]

WINDOW = 10_000_000_000  # [ns] how long samples are kept


# Up from the source and up from the target, without the part that both share.
_Chain = tuple[tuple[TimeCache, ...], tuple[TimeCache, ...]]


class FrameBuffer:
    """Poses between any two frames at any time of the last ten seconds; several threads may fill and ask it."""

    def __init__(self, window: int = WINDOW) -> None:
        self._window = window
        self._caches: dict[str, TimeCache] = {}  # by child
        self._frames: set[str] = set()
        self._chains: dict[tuple[str, str], _Chain] = {}
        self._changed = Condition()

    def insert(self, frame: FrameTransform) -> bool:
        """Keep one sample of a moving frame; False where it is too old to be of use. Wakes who waits."""
        return self._insert(frame, is_static=False)

    def insert_static(self, frame: FrameTransform) -> bool:
        """Keep the pose of a frame that never moves; valid at all times."""
        return self._insert(frame, is_static=True)

    def insert_all(self, frames: FrameTransforms, is_static: bool = False) -> None:
        """Keep a whole message of them, waking once."""
        with self._changed:
            for frame in frames.transforms:
                self._insert(frame, is_static)

    def clear(self) -> None:
        """Forget every moving sample; for a clock that jumped backwards. Static frames stay."""
        with self._changed:
            self._caches = {child: cache for child, cache in self._caches.items() if cache.is_static}
            self._frames = set(self._caches) | {cache.parent for cache in self._caches.values()}
            self._chains.clear()

    @property
    def frames(self) -> tuple[str, ...]:
        """Every frame that was ever named."""
        with self._changed:
            return tuple(sorted(self._frames))

    def look_up(self, target: str, source: str, stamp: int = 0) -> Transform:
        """The pose of `source` in `target` at `stamp` [ns]; 0 is the latest time that all links of the chain share."""
        return to_message(self.look_up_rigid(target, source, stamp)[1])

    def look_up_stamped(self, target: str, source: str, stamp: int = 0) -> FrameTransform:
        """As `look_up`, with the time [ns] that the answer is for; 0 where only static frames are between them."""
        found, pose = self.look_up_rigid(target, source, stamp)
        return FrameTransform(stamp=found, parent=target, child=source, transform=to_message(pose))

    def look_up_rigid(self, target: str, source: str, stamp: int = 0) -> tuple[int, Rigid]:
        """As `look_up_stamped`, as plain tuples."""
        with self._changed:
            up, down = self._chains.get((target, source)) or self._find_chain(target, source, stamp)
            time_asked = stamp or _latest_common(up, down)
            pose = _chain_pose(up, time_asked, self._window)
            if down:
                pose = compose(inverse(_chain_pose(down, time_asked, self._window)), pose)
            return time_asked, pose

    def wait(self, target: str, source: str, stamp: int = 0, timeout: float = 1.0) -> Transform:
        """As `look_up`, waiting up to `timeout` [s] for it to be possible; `WaitTimeout` has the last reason."""
        deadline = time.monotonic() + timeout
        with self._changed:
            while True:
                try:
                    return self.look_up(target, source, stamp)
                except PastError:
                    raise
                except FrameError as error:
                    left = deadline - time.monotonic()
                    if left <= 0.0:
                        raise WaitTimeout(_waited(timeout, source, target, error)) from error
                    self._changed.wait(left)

    def _insert(self, frame: FrameTransform, is_static: bool) -> bool:
        if not frame.parent or not frame.child or frame.parent == frame.child:
            raise ValueError(f'a transform from "{frame.parent}" to "{frame.child}" joins no two frames')
        pose = from_message(frame.transform)
        with self._changed:
            cache = self._caches.get(frame.child)
            if cache is None or cache.parent != frame.parent or cache.is_static != is_static:
                cache = self._new_cache(frame.parent, frame.child, is_static)
            if is_static:
                cache.stamps, cache.poses, kept = [0], [pose], True
            else:
                kept = cache.insert(frame.stamp, pose, self._window)
            self._changed.notify_all()
            return kept

    def _new_cache(self, parent: str, child: str, is_static: bool) -> TimeCache:
        """A frame that is new, or has a new parent: the ways through it are no longer known."""
        cache = self._caches[child] = TimeCache(parent, child, is_static)
        self._frames.update((parent, child))
        self._chains.clear()
        return cache

    def _find_chain(self, target: str, source: str, stamp: int) -> _Chain:
        for name in (target, source):
            if name not in self._frames:
                times = {"time": seconds(stamp), "newest": self._newest()}
                raise UnknownFrameError(because("frame.unknown", nearest(name, self._frames), name=name, **times))
        up, down = self._to_root(source, stamp), self._to_root(target, stamp)
        if (up[-1].parent if up else source) != (down[-1].parent if down else target):
            times = {"time": seconds(stamp), "newest": self._newest()}
            raise UnconnectedError(because("frame.unconnected", source=source, target=target, **times))
        while up and down and up[-1] is down[-1]:
            up.pop()
            down.pop()
        chain = self._chains[target, source] = (tuple(up), tuple(down))
        return chain

    def _to_root(self, frame: str, stamp: int) -> list[TimeCache]:
        caches: list[TimeCache] = []
        while (cache := self._caches.get(frame)) is not None:
            if cache in caches:
                ring = " in ".join(each.child for each in caches)
                times = {"time": seconds(stamp), "newest": self._newest()}
                raise UnconnectedError(because("frame.ring", name=frame, ring=ring, **times))
            caches.append(cache)
            frame = cache.parent
        return caches

    def _newest(self) -> str:
        stamps = [cache.stamps[-1] for cache in self._caches.values() if not cache.is_static and cache.stamps]
        return seconds(max(stamps)) if stamps else "no time yet"


def _latest_common(up: tuple[TimeCache, ...], down: tuple[TimeCache, ...]) -> int:
    """The newest time [ns] at which every moving cache is known; 0 where all are static."""
    latest = 0
    for cache in (*up, *down):
        if not cache.is_static:
            stamp = cache.stamps[-1]
            if latest == 0 or stamp < latest:
                latest = stamp
    return latest


def _chain_pose(caches: tuple[TimeCache, ...], stamp: int, window: int) -> Rigid:
    """The pose of the first cache's child in the last cache's parent."""
    if not caches:
        return IDENTITY
    pose = caches[0].at(stamp, window)
    for cache in caches[1:]:
        pose = compose(cache.at(stamp, window), pose)
    return pose


def _waited(timeout: float, source: str, target: str, error: FrameError) -> Reason:
    return because("frame.timeout", error.reason, time=timeout, source=source, target=target)
