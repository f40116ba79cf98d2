"""Poses of links, from the frames of the last ten seconds."""

from __future__ import annotations

from gemelo.api.errors import BadArgument, Lost, reason_of
from gemelo.api.session import PATIENCE, Session
from gemelo.api.units import Pose, pose_from
from gemelo.libraries.arm.errors import nearest
from gemelo.libraries.arm.frames.frame_buffer import FrameBuffer, FrameError
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import FRAMES, STATIC_FRAMES


class Frames:
    """Fills itself from the first look-up on."""

    def __init__(self, session: Session) -> None:
        self._session, self._buffer = session, FrameBuffer()

    def look_up(self, target: str, source: str, stamp: int = 0) -> Pose:
        """The pose of `source` in `target` at `stamp` [ns UNIX]; 0 is now. Raises `BadArgument` or `Lost`."""
        session = self._session
        session.latest(STATIC_FRAMES, lambda message: self._buffer.insert_all(message, is_static=True))
        session.latest(FRAMES, self._buffer.insert_all)
        if stamp == 0:
            session.newest(FRAMES)
        known = session.description.model.link_names
        session.wait_for(lambda: self._is_there(target, source), PATIENCE)
        try:
            return pose_from(self._buffer.look_up(target, source, stamp))
        except FrameError as error:
            for name in (target, source):
                if name not in (*known, *self._buffer.frames):
                    raise BadArgument(because("argument.frame.unknown", nearest(name, known), name=name)) from error
            raise Lost(reason_of(error)) from error

    def _is_there(self, target: str, source: str) -> bool:
        try:
            self._buffer.look_up(target, source)
        except FrameError:
            return target not in self._session.description.model.link_names and bool(self._buffer.frames)
        return True
