"""The parameters of the gateway."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from gemelo.schemas.topics import READINGS_REST_RATE, REST_RATE

ALL_STATES = 50.0  # [Hz] standard: of a core that publishes each state, as all did before there was a `rest_rate`


class GatewayParameters(msgspec.Struct, frozen=True, kw_only=True):
    """Defaults that suit MQTT on a good network."""

    trajectory_lead: Annotated[
        float, Meta(ge=0.1, le=1.5, description="[s] of path the device holds, beyond half its stopping time")
    ] = 0.30
    streaming_lead: Annotated[
        float, Meta(ge=0.06, le=1.5, description="[s] the same for streamed targets, where a device cannot replace")
    ] = 0.15
    stream_silence: Annotated[
        float, Meta(ge=0.05, le=10.0, description="[s] without a target until a stream ends, at rest")
    ] = 0.5
    target_delay: Annotated[
        float,
        Meta(ge=0.0, le=0.3, description="[s] by which streamed targets are played late, between them and not ahead"),
    ] = 0.04
    catch_up: Annotated[
        bool, Meta(description="an arm far behind streamed targets keeps their velocity; if not, it swings less")
    ] = True
    watch_streams: Annotated[
        bool, Meta(description="streamed targets move the arm only as far as the planner finds their way free")
    ] = True
    stream_margin: Annotated[
        float, Meta(ge=0.0, le=0.05, description="[m] that stays free on their way; 0: the robot's own clearance")
    ] = 0.0
    goal_time_tolerance: Annotated[
        float, Meta(ge=0.1, le=600.0, description="[s] a goal may end late, where it does not say itself")
    ] = 2.0
    tolerance_factor: Annotated[
        float, Meta(gt=0.0, le=1000.0, description="scales the path and goal tolerances of robot.toml")
    ] = 1.0
    start_tolerance: Annotated[
        float, Meta(ge=0.0, le=1.0, description="[rad] between a trajectory's start and the arm")
    ] = 0.01
    start_tolerance_linear: Annotated[float, Meta(ge=0.0, le=1.0, description="[m] the same for sliding joints")] = (
        0.002
    )
    velocity_margin: Annotated[
        float, Meta(ge=0.0, le=0.01, description="share by which a trajectory may exceed a velocity limit")
    ] = 0.001
    acceleration_margin: Annotated[
        float, Meta(ge=0.0, le=0.06, description="share by which a trajectory may exceed an acceleration limit")
    ] = 0.05
    corner_time: Annotated[
        float, Meta(ge=0.02, le=1.0, description="[s] over which corners of a positions-only trajectory are rounded")
    ] = 0.1
    state_timeout: Annotated[
        float, Meta(ge=0.1, le=10.0, description="[s] of silence after which the device is offline")
    ] = 0.5
    command_timeout: Annotated[
        float, Meta(ge=0.2, le=10.0, description="[s] after which an unanswered device command has failed")
    ] = 2.0
    record_inputs: Annotated[
        bool, Meta(description="publish what the core is given, twice a second, so that a recording can be replayed")
    ] = True
    control_grace: Annotated[
        float, Meta(ge=0.5, le=60.0, description="[s] a holder of control may be gone until it loses it, at rest")
    ] = 3.0
    feedback_rate: Annotated[float, Meta(ge=1.0, le=50.0, description="[Hz] of goal feedback")] = 20.0
    rest_rate: Annotated[
        float, Meta(ge=1.0, le=50.0, description="[Hz] of states on the bus while nothing changes")
    ] = REST_RATE
    readings_rest_rate: Annotated[
        float,
        Meta(
            ge=0.5, le=50.0, description="[Hz] of sensors, gripper, step errors, ... on the bus while nothing changes"
        ),
    ] = READINGS_REST_RATE
