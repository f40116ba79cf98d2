"""The parts of an `Arm`, each made when it is first used; only then its module is loaded (`gemelo.api.__getattr__`)."""

from __future__ import annotations

from collections.abc import Callable
from threading import RLock
from typing import TYPE_CHECKING, Generic, TypeVar

from gemelo import api

if TYPE_CHECKING:
    from gemelo.api.control import Control
    from gemelo.api.device import Device
    from gemelo.api.frames import Frames
    from gemelo.api.gripping import Gripping
    from gemelo.api.jog import JogCommands
    from gemelo.api.ledger import Requirement
    from gemelo.api.motion import MotionRegistry
    from gemelo.api.scene import Scene
    from gemelo.api.seeing import Eyes
    from gemelo.api.session import Session
    from gemelo.api.streaming import Streaming

T = TypeVar("T")


class part(Generic[T]):  # noqa: N801 a decorator
    """A property of `Parts` that is made once, whichever thread is the first to use it."""

    def __init__(self, make: Callable[[Parts], T]) -> None:
        self._make, self._name = make, make.__name__

    def __get__(self, parts: Parts, _owner: type) -> T:
        with parts.lock:
            made = vars(parts)
            if self._name not in made:
                made[self._name] = self._make(parts)
            found: T = made[self._name]
            return found


class Parts:
    """What one arm is made of."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.lock = RLock()  # some parts use others

    def require_motion(self) -> None:
        """Before every motion; raises `Refused`."""
        self.control.prepare()
        self.requirement.check()

    def close(self) -> None:
        """Decelerates the motions that are attached to this connection, where there have been any."""
        if "motions" in vars(self):
            self.motions.cancel_attached()

    @part
    def control(self) -> Control:
        return api.control.Control(self.session)

    @part
    def device(self) -> Device:
        return api.device.Device(self.session, self.control.prepare)

    @part
    def eyes(self) -> Eyes:
        return api.seeing.Eyes(self.session, self.scene)

    @part
    def frames(self) -> Frames:
        return api.frames.Frames(self.session)

    @part
    def gripping(self) -> Gripping:
        return api.gripping.Gripping(self.session, self.scene)

    @part
    def jogging(self) -> JogCommands:
        return api.jog.JogCommands(self.session)

    @part
    def motions(self) -> MotionRegistry:
        return api.motion.MotionRegistry(self.session, self.require_motion)

    @part
    def requirement(self) -> Requirement:
        return api.ledger.Requirement(self.session)

    @part
    def scene(self) -> Scene:
        return api.scene.Scene(self.session)

    @part
    def streaming(self) -> Streaming:
        return api.streaming.Streaming(self.session)
