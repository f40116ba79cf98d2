"""Python and the firmware core read the same in every configuration, or the core says why it refuses it."""

from __future__ import annotations

import json
from pathlib import Path

import msgspec
import pytest
from device_configs import I32, good_configs
from hypothesis import HealthCheck, assume, given
from hypothesis import strategies as st
from msgspec.structs import replace

from gemelo.firmware.bindings.parsers import ConfigTextRefused, read_config
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.device_config import DeviceConfig, JointConfig, config_text
from tests.profiles import examples

LARGEST = 8220  # [bytes] kMaxConfigText of core/config_text.h
ANY_NUMBER = st.integers(-(2**65), 2**65) | st.integers(-300, 300) | I32
OFTEN = examples(quick=25, suppress_health_check=[HealthCheck.too_slow])


def numbers_of(config: DeviceConfig) -> list[tuple[str | int, ...]]:
    """The places of all integers in the JSON of `config`."""

    def walk(value: object, path: tuple[str | int, ...]) -> list[tuple[str | int, ...]]:
        if isinstance(value, dict):
            return [found for key, item in value.items() for found in walk(item, (*path, key))]
        if isinstance(value, list):
            return [found for index, item in enumerate(value) for found in walk(item, (*path, index))]
        return [path] if isinstance(value, int) and not isinstance(value, bool) else []

    return walk(msgspec.to_builtins(config), ())


def with_number(config: DeviceConfig, path: tuple[str | int, ...], number: int) -> DeviceConfig:
    tree = json.loads(config_text(config))
    place = tree
    for step in path[:-1]:
        place = place[step]
    place[path[-1]] = number
    return msgspec.convert(tree, DeviceConfig)


def assert_agreed(text: bytes) -> None:
    """The core reads what Python reads, or refuses with a sentence."""
    try:
        read = read_config(text)
    except ConfigTextRefused as refused:
        reason = refused.reason
    else:
        assert read == msgspec.json.decode(text, type=DeviceConfig)
        return
    assert len(reason.split()) >= 3, reason


@OFTEN
@given(good_configs())
def test_a_good_configuration_is_read_to_the_last_field(config: DeviceConfig):
    text = config_text(config)
    assume(len(text) <= LARGEST)
    assert read_config(text) == config


@OFTEN
@given(st.data())
def test_any_number_anywhere_is_read_as_it_is_or_refused_with_a_sentence(data: st.DataObject):
    config = data.draw(good_configs())
    path = data.draw(st.sampled_from(numbers_of(config)))
    assert_agreed(config_text(with_number(config, path, data.draw(ANY_NUMBER))))


@OFTEN
@given(good_configs(), st.text(max_size=40))
def test_any_name_is_read_as_it_is_or_refused_with_a_sentence(config: DeviceConfig, name: str):
    first = replace(config.joints[0], name=name)
    assert_agreed(config_text(replace(config, joints=(first, *config.joints[1:]))))


@OFTEN
@given(good_configs(), st.integers(0, 2000), st.integers(0, 255))
def test_a_changed_byte_is_read_as_python_reads_it_or_refused_with_a_sentence(
    config: DeviceConfig, place: int, byte: int
):
    text = bytearray(config_text(config))
    text[place % len(text)] = byte
    assert_agreed(bytes(text))


def test_what_is_left_out_has_the_same_default_on_both_sides():
    joint = JointConfig(name="q1", lower_q8=0, upper_q8=1, max_velocity_q8=1, max_acceleration_q8=1)
    config = DeviceConfig(name="x", joints=(joint,))
    short = (
        b'{"name":"x","joints":[{"name":"q1","lower_q8":0,"upper_q8":1,"max_velocity_q8":1,"max_acceleration_q8":1}]}'
    )
    assert read_config(short) == read_config(config_text(config)) == config


def test_a_text_that_no_packet_could_carry_is_refused():
    with pytest.raises(ConfigTextRefused, match=f"its text is longer than {LARGEST} bytes"):
        read_config(b" " * (LARGEST + 1))


@pytest.mark.parametrize("robot", ["rm1", "parol6"])
def test_the_projects_own_robots_are_taken(robot: str):
    config = device_config(load_arm(Path(__file__).resolve().parents[2] / "urdf" / robot))
    assert read_config(config_text(config)) == config
