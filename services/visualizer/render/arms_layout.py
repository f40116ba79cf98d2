"""The layout of a view that several arms share: all of them side by side, and behind a tab everything of each.

Every arm has a scene of its own: where they stand to one another no file says.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import rerun as rr
import rerun.blueprint as rrb

from gemelo.schemas.reasons import because
from gemelo.services.visualizer.content import entities, palette
from gemelo.services.visualizer.content.view_words import band_labels
from gemelo.services.visualizer.render.layout import ArmLayout, last, on_one_screen, past, time_panel

IN_A_ROW = 3  # arms, beside one another, whose plots stay readable


@dataclass(frozen=True)
class SharedView:
    """A view of several arms, as the visualizer of one of them has it."""

    robot: str  # this one's name
    arms: tuple[ArmLayout, ...]  # of all


def arms_blueprint(arms: Sequence[ArmLayout]) -> rrb.Blueprint:
    """The layout for all these arms; each visualizer sends the same one, so that none of them need be there first."""
    return on_one_screen(rrb.Tabs(_all(arms), *(arm.whole() for arm in arms), active_tab=0), time_panel())


def _all(arms: Sequence[ArmLayout]) -> rrb.Container:
    rows = math.ceil(len(arms) / IN_A_ROW)
    columns = [_column(arm) for arm in arms]
    return rrb.Grid(*columns, grid_columns=math.ceil(len(arms) / rows), name=arms[0].say(because("view.title.arms")))


def _column(arm: ArmLayout) -> rrb.Container:
    """Of one arm: where it is, what it lost, what its device does and what is said of it."""
    return rrb.Vertical(
        arm.scene(arm.say(because("view.title.scene_of", robot=arm.robot))),
        _errors(arm),
        arm.modes(arm.say(because("view.title.modes_of", robot=arm.robot))),
        arm.log(arm.say(because("view.title.log_of", robot=arm.robot))),
        row_shares=[9, 5, 2, 3], name=arm.robot,
    )  # fmt: skip


def _errors(arm: ArmLayout) -> rrb.TimeSeriesView:
    """The step errors of all joints in one plot, each in a colour of its own, with the band of half a step."""
    joints = [joint.name for joint in arm.model.moving]
    drawn = {
        arm.at(entities.error(name)): rr.SeriesLines.from_fields(
            colors=[palette.JOINTS[index % len(palette.JOINTS)], palette.BAND, palette.BAND],
            names=[name, *band_labels(arm.language)],
        )
        for index, name in enumerate(joints)
    }
    return rrb.TimeSeriesView(
        origin=arm.at(entities.JOINTS),
        contents=[f"+ /{entity}" for entity in drawn],
        name=arm.say(because("view.title.errors_of", robot=arm.robot)),
        axis_x=rrb.TimeAxis(view_range=past(arm.window)),
        plot_legend=rrb.PlotLegend("LeftTop", visible=True),
        time_ranges=[last(arm.window)],
        overrides=drawn,
    )
