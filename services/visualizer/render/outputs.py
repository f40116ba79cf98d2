"""The outputs of the visualizer: the viewer while there is one, and a recording on request."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated

import msgspec
import rerun as rr
from msgspec import Meta

from gemelo.libraries.recordings.view_layout import SECONDS
from gemelo.schemas.deployment import ViewerMode, ViewerSection
from gemelo.services.visualizer.core import Visualizer
from gemelo.services.visualizer.program.viewer_connection import ViewerConnection
from gemelo.services.visualizer.render.arms_layout import SharedView, arms_blueprint
from gemelo.services.visualizer.render.layout import ArmLayout, blueprint
from gemelo.services.visualizer.render.recording_file import RecordingFile
from gemelo.services.visualizer.render.sink import APPLICATION, Sink

# Rerun looks 125 times a second whether there is something to send; this is half of what comes ten times a second.
BATCHES = rr.ChunkBatcherConfig(flush_tick=0.05)  # [s] chosen
SHARED_RECORDING = "arms-live"  # the same of every arm, or the viewer would show them one at a time


class VisualizerParameters(msgspec.Struct, frozen=True, kw_only=True):
    """Read at the start; the viewer itself is chosen by the deployment."""

    recording_path: Annotated[str, Meta(description="also write a Rerun recording (.rrd) there; empty: none")] = ""
    window: Annotated[float, Meta(description="[s] of the past that the plots show", gt=0)] = SECONDS
    trail: Annotated[float, Meta(description="[s] of the tool's way that stays visible", gt=0)] = SECONDS


class Outputs:
    """One stream per sink; a viewer that is new is told everything from the start.

    A viewer may be `shared` with other arms; a recording is this arm's alone.
    """

    def __init__(
        self,
        viewer: ViewerSection,
        robot: Path,
        root: Path,
        parameters: VisualizerParameters,
        cameras: tuple[str, ...] = (),
        shared: SharedView | None = None,
    ) -> None:
        self._connection = None if viewer.mode is ViewerMode.NONE else ViewerConnection(viewer.host, viewer.port)
        self._folder, self._cameras = robot, cameras
        self._parameters = parameters
        self._shared = shared
        self._recording_path = root / parameters.recording_path if parameters.recording_path else None
        self._viewer: Sink | None = None
        self._recording: RecordingFile | None = None

    def step(self, core: Visualizer, now: int, monotonic: float) -> str:
        """Sends a batch; `now` in [ns] UNIX, `monotonic` in [s]. Returns why an output is missing, or an empty text."""
        recording = self._followed_recording(core, monotonic)
        self._follow_viewer(core, monotonic)
        updates = core.step(now)
        for sink in (self._viewer, recording):
            if sink is not None:
                sink.write(updates)
        if self._connection is not None and self._viewer is None:
            return f"no viewer at {self._connection.host}:{self._connection.port}"
        return "" if self._recording is None else self._recording.problem

    def close(self) -> None:
        """Hand over what is left, in clamp_stamp time."""
        if self._recording is not None:
            self._recording.close()
        if self._viewer is not None and self._connection is not None and self._connection.is_alive:
            with suppress(RuntimeError):  # it may end while we hand over
                self._viewer.close(timeout=1.0)
        if self._connection is not None:
            self._connection.close()

    def _followed_recording(self, core: Visualizer, monotonic: float) -> Sink | None:
        """The recording's sink, while its disk takes it."""
        if self._recording_path is None:
            return None
        if self._recording is None:
            self._recording = RecordingFile(
                self._recording_path, _own_recording(core), lambda stream: self._own_sink(stream, core)
            )
        if self._recording.step(monotonic):
            core.restart()
        return self._recording.sink

    def _follow_viewer(self, core: Visualizer, monotonic: float) -> None:
        if self._connection is None:
            return
        if self._viewer is not None and not self._connection.is_alive:
            self._viewer = None
        if self._viewer is None and self._connection.is_new(monotonic):
            self._viewer = self._viewers_sink(self._connection.url, core)
            core.restart()

    def _viewers_sink(self, url: str, core: Visualizer) -> Sink:
        recording_id = _own_recording(core) if self._shared is None else SHARED_RECORDING
        stream = rr.RecordingStream(APPLICATION, recording_id=recording_id, batcher_config=BATCHES)
        stream.connect_grpc(url)
        if self._shared is None:
            return self._own_sink(stream, core)
        layout, robot = arms_blueprint(self._shared.arms), self._shared.robot
        return Sink(stream, core.model, self._folder, layout, robot, language=core.language)

    def _own_sink(self, stream: rr.RecordingStream, core: Visualizer) -> Sink:
        shown = self._parameters
        layout = ArmLayout(core.model, shown.window, shown.trail, self._cameras, language=core.language)
        return Sink(stream, core.model, self._folder, blueprint(layout), language=core.language)


def _own_recording(core: Visualizer) -> str:
    return f"{core.model.name}-live"
