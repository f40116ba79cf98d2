"""The three-dimensional picture, one for all browsers: arms, gizmo, paths, obstacles and contacts."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping
from math import ceil

import numpy as np
import viser

import gemelo
from gemelo.libraries.runtime.deployment import project_root
from gemelo.services.panel.model.goal import GoalState
from gemelo.services.panel.model.operator import Operator
from gemelo.services.panel.model.tool_turns import ALL_RINGS, NO_RINGS, ToolTurns
from gemelo.services.panel.view.arms import Array, DrawnArm
from gemelo.services.panel.view.obstacles import DrawnObstacles

GOAL, BAD_GOAL, GHOST = (1.0, 0.62, 0.1, 0.45), (0.9, 0.2, 0.15, 0.5), (0.25, 0.55, 1.0, 0.35)
PLANNED, EXECUTED = (40, 110, 230), (30, 150, 70)
APART = 2e-3  # [rad] or [m]: a goal nearer than that is where the arm is, and is not drawn over it
TRAIL = 400  # points of the executed path
STEP = 0.002  # [m] between two of them
REDRAWN = 0.25  # [s] between two drawings of the executed path
ABOVE = 0.03  # [m] chosen: a goal by a click is so high above the surface that a gripper's finger is clear of it
EYE, SEEN = (1.35, -1.15, 0.95), (0.35, 0.1, 0.1)  # where the camera is and looks at first, in reaches of the arm
ASPECT = 1.1  # of a picture in which the arm is seen whole from there
FARTHEST = 4.0  # times as far, at most
GHOST_RATE = 20.0  # [Hz] of the plan that is played


class DrawnWorld:
    """Everything drawn under the server's scene, each part with a name for what it shows; `update` is called again and
    again, and draws what has changed."""

    def __init__(self, server: viser.ViserServer, operator: Operator) -> None:
        arm = operator.arm.description
        self._operator, self._scene = operator, server.scene
        self._base, self._tool = arm.base_frame, arm.tool_frame
        self.measured = DrawnArm(server, arm, "/measured")
        self.goal = DrawnArm(server, arm, "/goal", GOAL)
        self.bad_goal = DrawnArm(server, arm, "/bad_goal", BAD_GOAL)
        self.ghost = DrawnArm(server, arm, "/ghost", GHOST)
        self.obstacles = DrawnObstacles(server, (project_root(), arm.folder))
        reach = max(0.3, float(np.linalg.norm(operator.goal.goal.pose.position)))
        self._set_stage(server, reach)
        self.gizmos = self._make_gizmos(0.35 * reach, operator.goal.turns)
        on_tool = f"{self.measured.node_of(self._tool)}/axes"
        self._scene.add_frame(on_tool, axes_length=0.12 * reach, axes_radius=0.004 * reach)
        self._dragged: viser.TransformControlsHandle | None = None
        self._tool_pose = operator.goal.goal.pose
        for gizmo in self.gizmos:
            self._follow(gizmo)
        self._goal_version = -1
        self._trail: deque[Array] = deque(maxlen=TRAIL)
        self._trail_drawn = 0.0
        self._path_stamp = 0
        self._played_at = 0.0
        self.is_playing, self.scrubbed = True, 0.0  # [s] of the plan that the ghost shows while it does not play

    def update(self, measured: Mapping[str, float]) -> None:
        """One picture of the arm at these joint values [rad] or [m], and of all else."""
        goal = self._operator.goal.goal
        if self.measured.show(measured):
            self._tool_moved()
        self._show_goal(goal, measured)
        self._show_plan()
        contacts = goal.problem.contacts if goal.problem is not None else ()
        bus = self._operator.bus
        self.obstacles.show((*bus.scene.objects, *bus.jaws), contacts, self.measured.node_of)

    @property
    def period(self) -> float:
        """[s] after which it wants to be drawn again, though nobody has said anything new."""
        return 1.0 / GHOST_RATE if self.ghost.is_visible and self.is_playing else float("inf")

    @property
    def tool_pose(self) -> gemelo.Pose:
        """Of the measured arm, in the base frame, as it is drawn."""
        return self._tool_pose

    def place_goal(self, event: viser.SceneClickEvent) -> None:
        """The goal a little above the surface that was clicked."""
        hit = self.obstacles.under_the_cursor(np.array(event.ray_origin), np.array(event.ray_direction))
        if hit is not None:
            x, y, z = (hit + np.array((0.0, 0.0, ABOVE))).tolist()
            pose = gemelo.Pose((x, y, z), self._operator.goal.goal.pose.orientation)
            self._operator.goal.set_pose(pose, event.client_id)

    def step_back(self, client: viser.ClientHandle, aspect: float) -> None:
        """Shows all of the arm in a narrow picture; `aspect` is the ratio of its width to its height."""
        if aspect < ASPECT:
            client.camera.position = self.seen + min(FARTHEST, ASPECT / aspect) * (self.eye - self.seen)
            client.camera.look_at = self.seen  # which viser has led along with the position

    def _set_stage(self, server: viser.ViserServer, reach: float) -> None:
        size = 2.0 * ceil(4.0 * reach) / 2.0
        self._scene.add_grid("/ground", size, size, cell_size=0.1, section_size=0.5, infinite_grid=False)
        self._scene.configure_environment_map(None)
        self._scene.configure_default_lights(True)
        self._scene.add_light_ambient("/lights/ambient", intensity=0.9)
        self.eye, self.seen = (reach * np.array(point) for point in (EYE, SEEN))
        server.initial_camera.position, server.initial_camera.look_at = self.eye, self.seen

    def _make_gizmos(self, scale: float, turns: ToolTurns) -> list[viser.TransformControlsHandle]:
        """Arrows and rings; where not all rings are to be had, which viser has together with the arrows only, two."""
        add, rings = self._scene.add_transform_controls, turns.rings
        along = ALL_RINGS if rings == ALL_RINGS else turns.arrows
        arrows = add(
            "/gizmo", scale=scale, active_axes=along, disable_rotations=rings != ALL_RINGS, depth_test=False
        )  # fmt: skip
        if rings in (ALL_RINGS, NO_RINGS):
            return [arrows]
        turning = add(
            "/gizmo_turn", scale=scale, active_axes=rings, disable_axes=True, disable_sliders=True, depth_test=False
        )
        return [arrows, turning]

    def _follow(self, gizmo: viser.TransformControlsHandle) -> None:
        @gizmo.on_update
        async def _(event: viser.TransformControlsEvent) -> None:  # in viser's loop: in the order of the drag
            self._dragged = None if event.phase == "end" else gizmo
            if event.phase == "end":
                self._operator.goal.settle()
                return
            w, a, b, c = (float(value) for value in event.target.wxyz)
            x, y, z = (float(value) for value in event.target.position)
            pose = gemelo.Pose((x, y, z), (a, b, c, w))
            source = event.client_id if event.client_id is not None else -1
            self._operator.goal.set_pose(pose, source, is_turned=gizmo is not self.gizmos[0])

    def _show_goal(self, goal: GoalState, measured: Mapping[str, float]) -> None:
        apart = any(abs(at - measured.get(name, at)) > APART for name, at in goal.joints.items())
        is_bad = goal.problem is not None and goal.wanted is None
        self.goal.is_visible = apart and not is_bad
        self.bad_goal.is_visible = is_bad
        if goal.version == self._goal_version:
            return
        self._goal_version = goal.version
        (self.bad_goal if is_bad else self.goal).show(goal.joints)
        a, b, c, w = goal.pose.orientation
        for gizmo in self.gizmos:
            if gizmo is not self._dragged:
                gizmo.position = goal.pose.position
                gizmo.wxyz = (w, a, b, c)

    def _show_plan(self) -> None:
        motions, path = self._operator.motions, self._operator.bus.planned_path
        if path.stamp != self._path_stamp and len(path.points) > 1:
            self._path_stamp = path.stamp
            self._draw_line("/planned", np.array(path.points), PLANNED)
        plan = motions.plan
        self.ghost.is_visible = plan is not None and motions.shows_plan and not motions.is_moving
        if plan is None or not self.ghost.is_visible:
            return
        now = time.monotonic()
        if now - self._played_at < 1.0 / GHOST_RATE:
            return
        self._played_at = now
        at = now % (plan.duration + 0.7) if self.is_playing else self.scrubbed
        self.ghost.show(configuration_at(plan, at))

    def _tool_moved(self) -> None:
        point, orientation = self.measured.pose(self._tool)
        self._tool_pose = gemelo.Pose(point, orientation)
        tip = np.array(point)
        if self._trail and float(np.linalg.norm(self._trail[-1] - tip)) < STEP:
            return
        self._trail.append(tip)
        if len(self._trail) > 1 and time.monotonic() - self._trail_drawn > REDRAWN:
            self._trail_drawn = time.monotonic()
            self._draw_line("/executed", np.array(self._trail), EXECUTED)

    def _draw_line(self, name: str, points: Array, color: tuple[int, int, int]) -> None:
        segments = np.stack([points[:-1], points[1:]], axis=1)
        self._scene.add_line_segments(name, segments, color, thickness=2.5, thickness_units="screen")


def configuration_at(plan: gemelo.Plan, time_from_start: float) -> Mapping[str, float]:
    """Joint values [rad] or [m] of the plan at `time_from_start` [s], straight between its points."""
    points = plan.trajectory.points
    times = [point.time_from_start for point in points]
    rows = np.array([point.positions for point in points])
    values = [float(np.interp(time_from_start, times, column)) for column in rows.T]
    return dict(zip(plan.trajectory.joint_names, values, strict=True))
