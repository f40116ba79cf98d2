"""The layout (blueprint) of the view: the arm, its joints, its step errors and the device, on one screen."""

from __future__ import annotations

from dataclasses import dataclass

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TimelineColumn

from services.visualizer.content import entities, palette
from services.visualizer.core import unit
from services.visualizer.model.visual_model import VisualJoint, VisualModel

TIMELINE = entities.TIMELINE
JOINTS_PER_PAGE = 3  # rows of plots that stay readable


LEAD, FOLLOW = 5.0, 2.0  # [s] before and after a moment that are played again and again


@dataclass(frozen=True)
class Moment:
    """A time that the view of a recording opens at, and what is told of it."""

    stamp: int  # [ns] UNIX
    story: str  # Markdown


def blueprint(
    model: VisualModel, window: float, trail: float, cameras: tuple[str, ...] = (), moment: Moment | None = None
) -> rrb.Blueprint:
    """The layout for this arm and its cameras, live or around a moment; `window` and `trail` in [s]."""
    scene = rrb.Vertical(
        _scene_and_cameras(model, trail, cameras),
        rrb.Horizontal(_panel(), rrb.Vertical(_modes(window), _log(), row_shares=[5, 9]), column_shares=[11, 8]),
        row_shares=[17, 10],
        name="Twin",
    )
    return rrb.Blueprint(
        rrb.Horizontal(scene, _beside(model, window, moment), column_shares=[11, 9]),
        _time_panel(moment),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def _beside(model: VisualModel, window: float, moment: Moment | None) -> rrb.Container:
    """The joints; above them what happened, where that is told."""
    if moment is None:
        return _joints(model, window)
    story = rrb.TextDocumentView(origin=entities.STORY, name="What happened")
    return rrb.Vertical(story, _joints(model, window), row_shares=[3, 4])


def _time_panel(moment: Moment | None) -> rrb.TimePanel:
    if moment is None:
        return rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following")
    around = rr.encodings.AbsoluteTimeRange(min=moment.stamp - int(LEAD * 1e9), max=moment.stamp + int(FOLLOW * 1e9))
    return rrb.TimePanel(
        state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="selection", time_selection=around
    )


def _scene_and_cameras(model: VisualModel, trail: float, cameras: tuple[str, ...]) -> rrb.Spatial3DView | rrb.Container:
    """The scene; beside it the images where there are cameras."""
    views = [
        rrb.Spatial2DView(origin=entities.camera_picture(name), name=f"Camera {name}: found things (green)")
        for name in cameras
    ]
    if not views:
        return _scene(model, trail)
    return rrb.Horizontal(_scene(model, trail), rrb.Vertical(*views), column_shares=[3, 2])


def _scene(model: VisualModel, trail: float) -> rrb.Spatial3DView:
    size, waist = max(model.reach, 2.1 * model.height), 0.6 * model.height  # an arm that stands needs a step back
    return rrb.Spatial3DView(
        origin=entities.WORLD,
        name="Twin: measured (solid), commanded (blue), planned arm and way (cyan), what touches (red) [m]",
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.1, color=palette.GRID),
        background=rrb.Background(kind="SolidColor", color=palette.BACKGROUND),
        eye_controls=rrb.EyeControls3D(
            kind="Orbital",
            position=(0.86 * size, -0.72 * size, waist + 0.47 * size),
            look_target=(0.24 * size, 0.0, waist),
            eye_up=(0.0, 0.0, 1.0),
        ),
        overrides={entities.TRAIL: rrb.VisibleTimeRanges([_last(trail)])},
    )


def _joints(model: VisualModel, window: float) -> rrb.Container:
    moving = model.moving
    pages = [moving[first : first + JOINTS_PER_PAGE] for first in range(0, len(moving), JOINTS_PER_PAGE)]
    grids = [_page(page, window) for page in pages]
    return grids[0] if len(grids) == 1 else rrb.Tabs(*grids, name="Joints")


def _page(joints: tuple[VisualJoint, ...], window: float) -> rrb.Container:
    name = " · ".join(joint.name for joint in joints)
    rows = [rrb.Horizontal(_position(joint, window, joint is joints[0]), _error(joint, window)) for joint in joints]
    return rrb.Vertical(*rows, name=name)


def _position(joint: VisualJoint, window: float, has_legend: bool) -> rrb.TimeSeriesView:
    return _plot(entities.position(joint.name), f"{joint.name} · position [{unit(joint)}]", window, has_legend)


def _error(joint: VisualJoint, window: float) -> rrb.TimeSeriesView:
    return _plot(entities.error(joint.name), f"{joint.name} · step error [steps]", window, False)


def _plot(origin: str, name: str, window: float, has_legend: bool) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=origin,
        name=name,
        axis_x=rrb.TimeAxis(view_range=_range(window)),
        plot_legend=rrb.PlotLegend("LeftTop", visible=has_legend),
        time_ranges=[_last(window)],
    )


def _panel() -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=entities.PANEL, name="Device")


def _modes(window: float) -> rrb.StateTimelineView:
    return rrb.StateTimelineView(
        origin=entities.MODE, name="Mode of the device", time_view=rrb.TimeAxis(view_range=_range(window))
    )


def _log() -> rrb.TextLogView:
    # The lines begin with their time of day; the column would show only the century.
    hidden = TimelineColumn(TIMELINE, visible=False)
    return rrb.TextLogView(
        origin=entities.LOG,
        name="Log",
        columns=rrb.TextLogColumns(timeline_columns=[hidden], text_log_columns=["LogLevel", "Body"]),
    )


def _range(window: float) -> rr.TimeRange:
    relative = rr.TimeRangeBoundary.cursor_relative
    return rr.TimeRange(start=relative(seconds=-window), end=relative(seconds=0.0))


def _last(window: float) -> rrb.VisibleTimeRange:
    return rrb.VisibleTimeRange(TIMELINE, range=_range(window))
