"""Every configuration that the core takes, drawn by Hypothesis."""

from __future__ import annotations

import msgspec
from hypothesis import strategies as st
from msgspec.structs import replace

from gemelo.schemas.device_config import (
    UNUSED,
    DeviceConfig,
    HomingConfig,
    InputConfig,
    InputRole,
    JointConfig,
    OutputConfig,
    Pull,
    SensorConfig,
    SensorKind,
    ServoConfig,
)

I32 = st.integers(-(2**31), 2**31 - 1)
TRAVEL = st.integers(1, 2**30)
POSITIVE = st.integers(1, 2**31 - 1)
FLAG = st.booleans()
DIVISORS = [rate for rate in range(1, 1001) if 1000 % rate == 0]
NAMES = ["q", "Q_1-", *(f"{kind}_{number}" for kind in ("x", "a" * 29) for number in range(10))]


def names(count: int) -> st.SearchStrategy[list[str]]:
    """As many different names, of 1 to 31 bytes."""
    return st.permutations(NAMES).map(lambda order: order[:count])


@st.composite
def joints(draw: st.DrawFn, name: str, step_pin: int, dir_pin: int) -> JointConfig:
    lower = draw(st.integers(-(2**30), 2**30 - 1))
    is_wired = draw(FLAG)
    return JointConfig(
        name=name,
        lower_q8=lower,
        upper_q8=draw(st.integers(lower + 1, 2**30)),
        max_velocity_q8=draw(POSITIVE),
        max_acceleration_q8=draw(POSITIVE),
        inverted=draw(FLAG),
        dir_setup_us=draw(st.integers(0, 200)),
        step_pin=step_pin if is_wired else UNUSED,
        dir_pin=dir_pin if is_wired else UNUSED,
        text_scale_q32=draw(st.integers(0, 2**63 - 1)),
    )


@st.composite
def homings(draw: st.DrawFn, index: int, joint: JointConfig, tick_hz: int) -> HomingConfig:
    fast = draw(st.integers(1, min(joint.max_velocity_q8, tick_hz * 128)))
    direction, back_off = draw(st.sampled_from((1, -1))), draw(st.integers(1, 2**30 - 1))
    return HomingConfig(
        input=index,
        group=draw(st.integers(0, 15)),
        direction=direction,
        fast_q8=fast,
        slow_q8=draw(st.integers(1, fast)),
        back_off_q8=back_off,
        position_q8=draw(st.integers(joint.lower_q8, joint.upper_q8)) + direction * back_off,
        max_travel_q8=draw(POSITIVE),
        timeout_ms=draw(st.integers(1, 600_000)),
    )


@st.composite
def inputs(draw: st.DrawFn, name: str, pin: int, joint_count: int, may_be_estop: bool) -> InputConfig:
    is_estop = may_be_estop and draw(FLAG)
    return InputConfig(
        name=name,
        pin=pin,
        role=InputRole.ESTOP if is_estop else draw(st.sampled_from([r for r in InputRole if r is not InputRole.ESTOP])),
        joint=UNUSED if is_estop else draw(st.integers(0, joint_count - 1)),
        inverted=draw(FLAG),
        pull=draw(st.sampled_from(Pull)),
    )


@st.composite
def sensors(draw: st.DrawFn, name: str, pin: int, trigger_pin: int) -> SensorConfig:
    kind = draw(st.sampled_from(SensorKind))
    trigger = trigger_pin if kind is SensorKind.ULTRASONIC else UNUSED
    return SensorConfig(name=name, kind=kind, pin=pin, trigger_pin=trigger, scale_q16=draw(I32), offset_milli=draw(I32))


@st.composite
def servos(draw: st.DrawFn, pin: int) -> ServoConfig | msgspec.UnsetType:
    if pin == UNUSED or draw(FLAG):
        return msgspec.UNSET
    lower = draw(st.integers(500, 2499))
    return ServoConfig(
        name=draw(st.sampled_from(NAMES)),
        pin=pin,
        lower_us=lower,
        upper_us=draw(st.integers(lower + 1, 2500)),
        speed_us_s=draw(st.integers(10, 1_000_000)),
        off_at_estop=draw(FLAG),
    )


def may_home(switch: InputConfig, joint: int, direction: int) -> bool:
    """`switch` is one that this joint can look for in this direction."""
    other_end = InputRole.LIMIT_LOWER if direction > 0 else InputRole.LIMIT_UPPER
    return switch.joint == joint and switch.role is not other_end


@st.composite
def good_configs(draw: st.DrawFn) -> DeviceConfig:
    """What the core takes, to the ends of the ranges."""
    joint_count, input_count = draw(st.integers(1, 8)), draw(st.integers(0, 16))
    output_count, sensor_count = draw(st.integers(0, 8)), draw(st.integers(0, 8))
    pins = iter(draw(st.permutations(range(64))))
    tick_hz = draw(st.integers(10, 100)) * 1000
    arms = [draw(joints(name, next(pins), next(pins))) for name in draw(names(joint_count))]
    switches = [
        draw(inputs(name, next(pins), joint_count, may_be_estop=index == 0))
        for index, name in enumerate(draw(names(input_count)))
    ]
    for index, switch in enumerate(switches):
        if switch.joint != UNUSED:
            homing = draw(homings(index, arms[switch.joint], tick_hz))
            if may_home(switch, switch.joint, homing.direction):
                arms[switch.joint] = replace(arms[switch.joint], homing=homing)
    return DeviceConfig(
        name=draw(st.sampled_from(NAMES)),
        joints=tuple(arms),
        tick_hz=tick_hz,
        queue_capacity=draw(st.integers(2, 128)),
        state_hz=draw(st.sampled_from(DIVISORS)),
        sensor_hz=draw(st.sampled_from(DIVISORS)),
        hold_timeout_ms=draw(st.integers(1, 60_000)),
        enable_lead_ms=draw(st.integers(0, 10_000)),
        armed_at_boot=draw(FLAG),
        enable_pin=next(pins, UNUSED),
        enable_inverted=draw(FLAG),
        inputs=tuple(switches),
        outputs=tuple(
            OutputConfig(name=name, pin=next(pins), inverted=draw(FLAG), at_boot=draw(FLAG), off_at_estop=draw(FLAG))
            for name in draw(names(output_count))
        ),
        sensors=tuple(draw(sensors(name, next(pins), next(pins))) for name in draw(names(sensor_count))),
        servo=draw(servos(next(pins, UNUSED))),
    )
