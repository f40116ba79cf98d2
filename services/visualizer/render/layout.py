"""The layout (blueprint) of one arm's view: the arm, its joints, its step errors and the device, on one screen."""

from __future__ import annotations

from dataclasses import dataclass

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TimelineColumn

from gemelo.schemas.reasons import Reason, because, say
from gemelo.schemas.reasons.catalogue import ENGLISH
from gemelo.services.visualizer.content import entities, palette
from gemelo.services.visualizer.core import unit
from gemelo.services.visualizer.model.visual_model import VisualJoint, VisualModel

TIMELINE = entities.TIMELINE
JOINTS_PER_PAGE = 3  # rows of plots that stay readable

LEAD, FOLLOW = 5.0, 2.0  # [s] before and after a moment that are played again and again


@dataclass(frozen=True)
class OpeningMoment:
    """A time that the view of a recording opens at, and what is told of it."""

    stamp: int  # [ns] UNIX
    story: str  # Markdown


@dataclass(frozen=True)
class ArmLayout:
    """The views of one arm and its cameras; `window` and `trail` in [s].

    `robot` is its name where several arms share the viewer, and empty where it has one of its own.
    """

    model: VisualModel
    window: float
    trail: float
    cameras: tuple[str, ...] = ()
    robot: str = ""
    language: str = ENGLISH

    def say(self, reason: Reason) -> str:
        """The sentence in the language of the view."""
        return say(reason, self.language)

    def whole(self, moment: OpeningMoment | None = None) -> rrb.Container:
        """Everything of the arm, live or around a moment."""
        scene = rrb.Vertical(
            self._scene_and_cameras(),
            rrb.Horizontal(self._panel(), rrb.Vertical(self.modes(), self.log(), row_shares=[5, 9]),
                           column_shares=[11, 8]),
            row_shares=[17, 10],
            name=self.say(because("view.title.twin")),
        )  # fmt: skip
        return rrb.Horizontal(scene, self._beside(moment), column_shares=[11, 9], name=self.robot or None)

    def scene(self, name: str = "") -> rrb.Spatial3DView:
        """The arm in its planning scene; `name` is its heading if not the usual one."""
        model = self.model
        size, waist = max(model.reach, 2.1 * model.height), 0.6 * model.height  # an arm that stands needs a step back
        return rrb.Spatial3DView(
            origin=self.at(entities.WORLD),
            name=name or self.say(because("view.title.scene")),
            line_grid=rrb.LineGrid3D(visible=True, spacing=0.1, color=palette.GRID),
            background=rrb.Background(kind="SolidColor", color=palette.BACKGROUND),
            eye_controls=rrb.EyeControls3D(
                kind="Orbital",
                position=(0.86 * size, -0.72 * size, waist + 0.47 * size),
                look_target=(0.24 * size, 0.0, waist),
                eye_up=(0.0, 0.0, 1.0),
            ),
            overrides={self.at(entities.TRAIL): rrb.VisibleTimeRanges([last(self.trail)])},
        )

    def modes(self, name: str = "") -> rrb.StateTimelineView:
        """The device's modes over time."""
        name = name or self.say(because("view.title.modes"))
        return rrb.StateTimelineView(
            origin=self.at(entities.MODE), name=name, time_view=rrb.TimeAxis(view_range=past(self.window))
        )

    def log(self, name: str = "") -> rrb.TextLogView:
        """What the nodes and the device say."""
        # The lines begin with their time of day; the column would show only the century.
        hidden = TimelineColumn(TIMELINE, visible=False)
        columns = rrb.TextLogColumns(timeline_columns=[hidden], text_log_columns=["LogLevel", "Body"])
        return rrb.TextLogView(
            origin=self.at(entities.LOG), name=name or self.say(because("view.title.log")), columns=columns
        )

    def at(self, entity: str) -> str:
        """The entity where this arm has it."""
        return entities.under(self.robot, entity)

    def _beside(self, moment: OpeningMoment | None) -> rrb.Container:
        """The joints; above them what happened, where that is told."""
        if moment is None:
            return self._joints()
        story = rrb.TextDocumentView(origin=self.at(entities.STORY), name=self.say(because("view.title.story")))
        return rrb.Vertical(story, self._joints(), row_shares=[3, 4])

    def _scene_and_cameras(self) -> rrb.Spatial3DView | rrb.Container:
        """The scene; beside it the images where there are cameras."""
        views = [
            rrb.Spatial2DView(
                origin=self.at(entities.camera_picture(name)), name=self.say(because("view.title.camera", name=name))
            )
            for name in self.cameras
        ]
        if not views:
            return self.scene()
        return rrb.Horizontal(self.scene(), rrb.Vertical(*views), column_shares=[3, 2])

    def _joints(self) -> rrb.Container:
        moving = self.model.moving
        pages = [moving[first : first + JOINTS_PER_PAGE] for first in range(0, len(moving), JOINTS_PER_PAGE)]
        grids = [self._page(page) for page in pages]
        return grids[0] if len(grids) == 1 else rrb.Tabs(*grids, name=self.say(because("view.title.joints")))

    def _page(self, joints: tuple[VisualJoint, ...]) -> rrb.Container:
        name = " · ".join(joint.name for joint in joints)
        rows = [rrb.Horizontal(self._position(joint, joint is joints[0]), self._error(joint)) for joint in joints]
        return rrb.Vertical(*rows, name=name)

    def _position(self, joint: VisualJoint, has_legend: bool) -> rrb.TimeSeriesView:
        return self._plot(
            entities.position(joint.name),
            self.say(because("view.title.position", joint=joint.name, unit=unit(joint))),
            has_legend,
        )

    def _error(self, joint: VisualJoint) -> rrb.TimeSeriesView:
        return self._plot(entities.error(joint.name), self.say(because("view.title.error", joint=joint.name)), False)

    def _plot(self, entity: str, name: str, has_legend: bool) -> rrb.TimeSeriesView:
        return rrb.TimeSeriesView(
            origin=self.at(entity),
            name=name,
            axis_x=rrb.TimeAxis(view_range=past(self.window)),
            plot_legend=rrb.PlotLegend("LeftTop", visible=has_legend),
            time_ranges=[last(self.window)],
        )

    def _panel(self) -> rrb.TextDocumentView:
        return rrb.TextDocumentView(origin=self.at(entities.PANEL), name=self.say(because("view.title.device")))


def blueprint(arm: ArmLayout, moment: OpeningMoment | None = None) -> rrb.Blueprint:
    """The layout of a view with one arm, live or around a moment."""
    return on_one_screen(arm.whole(moment), time_panel(moment))


def on_one_screen(content: rrb.Container, time: rrb.TimePanel) -> rrb.Blueprint:
    """Without the panels in which a view is built."""
    return rrb.Blueprint(
        content, time, rrb.BlueprintPanel(state="hidden"), rrb.SelectionPanel(state="hidden"),
        auto_views=False, auto_layout=False,
    )  # fmt: skip


def time_panel(moment: OpeningMoment | None = None) -> rrb.TimePanel:
    """At the newest data, or around a moment."""
    if moment is None:
        return rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following")
    around = rr.encodings.AbsoluteTimeRange(min=moment.stamp - int(LEAD * 1e9), max=moment.stamp + int(FOLLOW * 1e9))
    return rrb.TimePanel(
        state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="selection", time_selection=around
    )


def past(window: float) -> rr.TimeRange:
    """The last `window` [s], for an axis."""
    relative = rr.TimeRangeBoundary.cursor_relative
    return rr.TimeRange(start=relative(seconds=-window), end=relative(seconds=0.0))


def last(window: float) -> rrb.VisibleTimeRange:
    """The last `window` [s], for what is shown."""
    return rrb.VisibleTimeRange(TIMELINE, range=past(window))
