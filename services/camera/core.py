"""One camera as the bus sees it: its images, and whether they come. Pure: frames, faults and time in, messages out."""

from __future__ import annotations

from collections import deque

from gemelo.schemas.camera import CameraCondition, CameraImage, CameraStatus
from gemelo.schemas.reasons import Reason, because
from gemelo.services.camera.sources.source import CameraFault, EncodedImage

SILENT = 1.5  # [s] without a new image before it counts as frozen
SILENT_PERIODS = 4.0  # and as many of its periods at least
SECOND = 1_000_000_000  # [ns]


class CameraCore:
    """Watches one camera; times `now` are in ns UNIX."""

    def __init__(self, name: str, fps: float, is_live: bool, now: int) -> None:
        """`is_live`: two equal images mean that it is stuck."""
        self.name = name
        self._is_live = is_live
        self._patience = int(max(SILENT, SILENT_PERIODS / fps) * SECOND)
        self._condition = CameraCondition.STARTING
        self._why: Reason | None = None
        self._last = b""  # the newest image of a live camera
        self._since = now  # of the newest new image, or of the start
        self._stamps: deque[int] = deque(maxlen=256)  # [ns] when images of the last second came
        self._said = -SECOND

    @property
    def condition(self) -> CameraCondition:
        return self._condition

    @property
    def text(self) -> str:
        """What is wrong and the remedy; empty while nothing is."""
        return str(self._why or "")

    def on_frame(self, frame: EncodedImage, now: int) -> CameraImage | None:
        """The message of an image; None where it is the same again, of a camera whose images cannot be."""
        if self._is_live and frame.data == self._last:
            return None
        self._last = frame.data if self._is_live else b""
        self._since = now
        self._stamps.append(now)
        self._become(CameraCondition.STREAMING, None)
        return CameraImage(
            stamp=frame.stamp,
            camera=self.name,
            width=frame.width,
            height=frame.height,
            encoding=frame.encoding,
            data=frame.data,
        )

    def on_fault(self, fault: CameraFault, now: int) -> None:
        """What has streamed and is missing now was unplugged."""
        condition = fault.condition
        if condition is CameraCondition.MISSING and self._condition in (
            CameraCondition.STREAMING, CameraCondition.UNPLUGGED, CameraCondition.FROZEN,
        ):  # fmt: skip
            condition = CameraCondition.UNPLUGGED
        self._since = now
        self._become(condition, fault.reason)

    def step(self, now: int) -> CameraStatus | None:
        """The status when it has changed, and once a second."""
        if self._condition in (CameraCondition.STREAMING, CameraCondition.STARTING):
            silent = now - self._since
            if silent > self._patience:
                what = because("camera.frozen", time=silent / SECOND)
                self._become(CameraCondition.FROZEN, because("camera.fault", what, camera=self.name))
        if now - self._said < SECOND:
            return None
        self._said = now
        while self._stamps and now - self._stamps[0] > SECOND:
            self._stamps.popleft()
        return CameraStatus(
            stamp=now,
            camera=self.name,
            condition=self._condition,
            text=self.text,
            fps=float(len(self._stamps)),
            why=self._why,
        )

    def _become(self, condition: CameraCondition, why: Reason | None) -> None:
        if condition is not self._condition or (why != self._why and condition is not CameraCondition.FROZEN):
            self._said = -SECOND  # at the next step
        self._condition, self._why = condition, why
