"""The tab that sets a goal, plans a path to it, shows the plan and executes it."""

from __future__ import annotations

import time

import viser

import gemelo
from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.planners import NAMES, PLANNERS
from gemelo.services.panel.model.motions import MotionChoice
from gemelo.services.panel.model.readings import Readings
from gemelo.services.panel.model.units import SHOWN, STEP, meant, slider_range, slider_value, text_of
from gemelo.services.panel.view.kit import OWN_CHANGE, Kit, Mirror, box, esc, note, set_if_new, table
from gemelo.services.panel.view.tabs.jog import jog_text
from gemelo.services.panel.view.tabs.tool_fields import ToolFields
from gemelo.services.panel.view.world import DrawnWorld

SCRUB = 100.0  # parts of the plan's duration


class MoveTab:
    """A slider for each joint, named states, Plan, Execute, and what is known of the plan.

    Here as in each tab the attributes without an underscore are the controls as a person sees them.
    """

    def __init__(self, kit: Kit, world: DrawnWorld) -> None:
        self._kit, self._world, self._operator = kit, world, kit.operator
        self._client = kit.client.client_id
        self._touched = 0.0  # [s] monotonic, of this browser's last slider
        self._goal_version = self._plan_version = -1
        words = kit.words
        self.problem = kit.line()
        self.nearest = kit.button(words("take_nearest"), self._take_nearest, color="orange")
        self.sliders = {joint.name: self._slider(joint) for joint in self._operator.arm.description.joints}
        self.tool = ToolFields(kit)
        self._state_names = tuple(self._operator.arm.states)
        if self._state_names:
            named = kit.gui.add_dropdown(words("named_state"), (words("choose"), *self._state_names))
            named.on_update(lambda event: self._name(event))
        ask = self._operator.motions.ask
        kit.button(words("plan"), self._operator.plan, color="blue", first=ask)
        self.execute = kit.button(words("execute"), self._operator.execute, color="gray", needs="move")
        kit.button(words("plan_and_execute"), self._operator.plan_and_execute, color="green", needs="move", first=ask)
        kit.reasons(move=words("execute"))
        self.plan = kit.line()
        self.play = kit.gui.add_checkbox(words("play"), True)
        self.scrub = kit.gui.add_slider(words("scrub"), 0.0, SCRUB, 0.5, 0.0)
        self.scrub.on_update(lambda event: self._show_moment(False) if event.client_id is not None else None)
        self.play.on_update(lambda event: self._show_moment(self.play.value))
        kit.button(words("goal_is_measured"), self._operator.follow_measured, color="gray")
        by_click = kit.gui.add_checkbox(words("click_goal"), False, hint=words("click_hint"))
        by_click.on_update(lambda event: self._set_by_click(event.target.value))
        self.live = kit.gui.add_checkbox(words("live"), False, hint=words("live_hint"))
        self._shown_live = Mirror(self.live)
        self.live.on_update(lambda event: self._switch_live(event))
        self.watched = kit.line()
        with kit.gui.add_folder(words("how"), expand_by_default=False):
            self._choices()

    def refresh(self, readings: Readings) -> None:
        """What has changed since the last time."""
        goal, motions = self._operator.goal.goal, self._operator.motions
        if goal.version != self._goal_version:
            self._goal_version = goal.version
            if goal.source != self._client or time.monotonic() - self._touched > OWN_CHANGE:
                self._write_sliders()
        elif goal.source == self._client and time.monotonic() - self._touched > OWN_CHANGE:
            self._write_sliders()
        self.tool.show(goal)
        self._show_problem()
        self._show_live()
        set_if_new(self.execute, "color", "green" if motions.has_plan_to_execute else "gray")
        if motions.version != self._plan_version or motions.is_moving or motions.is_planning:
            self._plan_version = motions.version
            set_if_new(self.plan, "content", self._plan_text())
            for handle in (self.scrub, self.play):
                set_if_new(handle, "visible", motions.plan is not None)

    def _slider(self, joint: Joint) -> viser.GuiSliderHandle[float]:
        lower, upper = slider_range(joint)
        at = slider_value(joint, self._operator.goal.goal.joints[joint.name])
        label = f"{joint.name} [{SHOWN[joint.unit]}]"
        slider = self._kit.gui.add_slider(label, lower, upper, STEP[joint.unit], at)

        @slider.on_update
        async def _(event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:  # in viser's loop: before a press
            if event.client_id is not None:  # that follows it
                self._touched = time.monotonic()
                self._operator.set_goal({joint.name: meant(joint, event.target.value)}, self._client)

        return slider

    def _write_sliders(self) -> None:
        for joint in self._operator.arm.description.joints:
            slider = self.sliders[joint.name]
            at = slider_value(joint, self._operator.goal.goal.joints[joint.name])
            if abs(slider.value - at) > STEP[joint.unit] / 2.0:
                set_if_new(slider, "value", at)

    def _choices(self) -> None:
        words, gui = self._kit.words, self._kit.gui
        kinds = (words("free_motion"), words("line_motion"))
        kind = gui.add_dropdown(words("path_kind"), kinds)
        speed = gui.add_slider(words("speed_share"), 1, 100, 1, round(100 * self._operator.choice.speed))
        hint = "; ".join(f"{row.name}: {row.text_in(words.language)}" for row in PLANNERS)
        self.planner = planner = gui.add_dropdown(words("planner"), (words("default"), *NAMES), hint=hint)

        def choose(event: viser.GuiEvent[viser.GuiInputHandle[object]]) -> None:
            if event.client_id is not None:
                chosen = planner.value if planner.value in NAMES else ""
                self._operator.choice = MotionChoice(kind.value == kinds[1], speed.value / 100.0, chosen)

        for handle in (kind, speed, planner):
            handle.on_update(choose)  # type: ignore[arg-type]

    def _name(self, event: viser.GuiEvent[viser.GuiDropdownHandle[str]]) -> None:
        if event.client_id is not None and event.target.value in self._state_names:
            self._operator.set_named(event.target.value)
            set_if_new(event.target, "value", self._kit.words("choose"))

    def _switch_live(self, event: viser.GuiEvent[viser.GuiCheckboxHandle]) -> None:
        if event.client_id is not None:
            self._operator.live.switch(event.target.value)
            if event.target.value:
                self._operator.follow_measured()

    def _show_live(self) -> None:
        """While the switch is on: that obstacles are watched, and what slows the arm."""
        operator, words = self._operator, self._kit.words
        self._shown_live.show(operator.live.is_on)
        told = (jog_text(operator, words) or note(esc(words("live_hint")))) if operator.live.is_on else ""
        set_if_new(self.watched, "content", told)

    def _set_by_click(self, is_wanted: bool) -> None:
        """Without a key, for this browser: a finger on a tablet has none."""
        scene = self._kit.client.scene
        if is_wanted:
            scene.on_click()(self._world.place_goal)
        else:
            scene.remove_click_callback(self._world.place_goal)

    def _take_nearest(self) -> None:
        problem = self._operator.goal.goal.problem
        if problem is not None:
            self._operator.take_nearest(problem)

    def _show_moment(self, is_playing: bool) -> None:
        plan = self._operator.motions.plan
        if plan is not None:
            set_if_new(self.play, "value", is_playing)
            self._operator.motions.shows_plan = True
            self._world.is_playing, self._world.scrubbed = is_playing, self.scrub.value / SCRUB * plan.duration

    def _show_problem(self) -> None:
        """What is wrong with the goal, unless the same is told above the tabs already."""
        goal, words, told = self._operator.goal.goal, self._kit.words, self._operator.newest_problem
        content = ""
        is_told = told is not None and goal.problem is not None and told.problem.is_same(goal.problem)
        if goal.problem is not None and not is_told:
            heading, text = words.problem(goal.problem)
            content = box(f"<b>{esc(heading)}</b><br>{esc(text)}", "#d9480f")
        elif goal.jumped and goal.problem is None:
            content = box(esc(words("jumped", joints=", ".join(goal.jumped))), "#f59f00")
        set_if_new(self.problem, "content", content)
        has_nearest = goal.problem is not None and goal.problem.has_nearest
        set_if_new(self.nearest, "visible", has_nearest and not is_told)

    def _plan_text(self) -> str:
        words, motions = self._kit.words, self._operator.motions
        if motions.is_planning:
            return box(esc(words("planning")), "#1c7ed6")
        moving = ""
        motion = motions.motion
        if motion is not None and not motion.is_over:
            moving = box(esc(words("moving", share=round(100 * motion.progress))), "#2f9e44")
        elif motion is not None:
            moving = self._arrival(motion)
        if motions.plan is None:
            return moving
        return moving + self._facts(motions.plan)

    def _facts(self, plan: gemelo.Plan) -> str:
        words = self._kit.words
        facts = [
            (esc(words("duration")), f"{plan.duration:.2f} s"),
            (esc(words("planner")), f"{esc(plan.planner)}, {1000 * plan.planning_time:.0f} ms"),
        ]
        for joint in self._operator.arm.description.joints:
            margin = plan.margins.get(joint.name)
            if margin is not None:
                facts.append((esc(joint.name), f"{100 * (1 - margin.share):.0f} % {esc(words('left'))}"))
        return table(facts) + note(esc(words("margins_note")))

    def _arrival(self, motion: gemelo.Motion) -> str:
        words = self._kit.words
        ended = esc(words.ended(motion.status))
        where = [
            (esc(joint.name), esc(text_of(joint, motion.stopped_at[joint.name])))
            for joint in self._operator.arm.description.joints
            if joint.name in motion.stopped_at
        ]
        try:
            if not motion.result.verified:
                return note(f"{ended}: {esc(words('sent_not_verified'))}")
            worst = max((abs(error) for error in motion.result.final_error), default=0.0)
        except gemelo.Error:
            return note(ended)
        return note(f"{ended}: {esc(words('final_error', steps=f'{worst:.2f}'))}") + (
            "" if motion.status.name == "SUCCEEDED" else table(where)
        )
