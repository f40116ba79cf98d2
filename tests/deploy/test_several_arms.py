"""`make up ARMS=...` before anything starts: what is made of one deployment for several arms, and what is refused."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import msgspec
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.runtime.deployment import (
    deployments_beside,
    load_deployment,
    project_root,
    robot_name,
)
from gemelo.libraries.runtime.started import deployment_of_arm
from gemelo.schemas.deployment import Deployment, DeviceKind, MqttSection, PanelSection, PathsSection, ViewerMode, Wire
from gemelo.schemas.errors import ConfigurationError
from gemelo.tools.stack.arms import deployment_file, file_of, stacked_arms
from gemelo.tools.stack.several_arms import compose_of, main, write
from gemelo.tools.stack.start_check import main as start_check

ROOT = project_root()
SINGLE = yaml.safe_load((ROOT / "process-compose.yaml").read_text())
BOTH = ("rm1", "parol6")


@pytest.fixture
def common(tmp_path) -> Deployment:
    return Deployment(paths=PathsSection(run=str(tmp_path / "run"), out=str(tmp_path / "out"), programs="/p"))


def copy_of(robot: str, folder: Path, *changes: tuple[str, str]) -> str:
    """A folder with a robot that is `robot` but for the changes to its robot.toml."""
    shutil.copytree(ROOT / "urdf" / robot, folder)
    file = folder / "robot.toml"
    text = file.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    file.write_text(text)
    return str(folder)


def refusal(names, common) -> str:
    with pytest.raises(ConfigurationError) as raised:
        stacked_arms(names, common, ROOT)
    return str(raised.value)


def test_each_arm_has_a_page_recordings_and_readiness_of_its_own_and_all_share_router_broker_and_view(common):
    first, second = (each.deployment for each in stacked_arms(BOTH, common, ROOT))
    assert (first.router, first.mqtt) == (second.router, second.mqtt) == (common.router, common.mqtt)
    assert (first.panel.port, second.panel.port) == (8088, 8089)
    assert first.viewer == second.viewer == common.viewer
    assert first.arms == second.arms == f"{common.paths.run}/arms"
    for name, each in zip(BOTH, (first, second), strict=True):
        assert each.paths.out == f"{common.paths.out}/{name}"
        assert each.paths.run == f"{common.paths.run}/{name}"
        assert each.paths.programs == common.paths.programs  # whose files bear the robot's name


def test_the_same_arm_twice_is_refused(common):
    assert 'rm1 twice: the robot "rm1" can be on a router once' in refusal(("rm1", "rm1"), common)


def test_two_folders_with_one_name_are_refused_and_both_are_named(common, tmp_path):
    said = refusal(("rm1", copy_of("rm1", tmp_path / "other")), common)
    assert f"{ROOT}/urdf/rm1 and {tmp_path}/other" in said


def test_two_arms_with_one_device_at_the_broker_are_refused_and_both_are_named(common, tmp_path):
    other = copy_of("parol6", tmp_path / "other", ('name = "parol6"', 'name = "left"'))
    said = refusal(("parol6", other), common)
    assert 'parol6 and left would both have the device "parol6" at the broker' in said


def test_two_boards_at_one_cable_are_refused_and_virtual_lines_are_each_arms_own(common):
    serial = msgspec.structs.replace(common, wire=Wire.SERIAL)
    assert len(stacked_arms(BOTH, serial, ROOT)) == 2
    boards = msgspec.structs.replace(serial, device=DeviceKind.BOARD)
    assert "rm1 and parol6 would both have a board at /dev/ttyUSB0" in refusal(BOTH, boards)


@pytest.mark.parametrize(
    ("port", "one", "other"),
    [
        (7446, "the router ([router] port)", "the page of parol6 ([panel] port + 1)"),
        (1883, "the broker ([mqtt] port)", "the page of rm1 ([panel] port)"),
        (9875, "the viewer's data ([viewer] port)", "the page of parol6 ([panel] port + 1)"),
        (9089, "the view ([viewer] web_port)", "the page of parol6 ([panel] port + 1)"),
    ],
)
def test_two_on_one_port_are_refused_and_both_are_named(common, port, one, other):
    said = refusal(BOTH, msgspec.structs.replace(common, panel=PanelSection(port=port)))
    assert one in said
    assert other in said


def test_a_port_beyond_the_last_one_is_refused(common):
    said = refusal(BOTH, msgspec.structs.replace(common, panel=PanelSection(port=65535)))
    assert "the page of parol6 ([panel] port + 1) would be 65536" in said


def test_an_arm_that_is_not_there_is_named_with_the_nearest(common):
    assert 'there is no arm "paro6"; did you mean "parol6"?' in refusal(("rm1", "paro6"), common)


def test_a_cell_file_in_the_folder_of_an_arm_is_that_arms_alone_and_any_other_is_everybodys(common, tmp_path):
    own = msgspec.structs.replace(common, cell=str(ROOT / "urdf/rm1/cell.toml"))
    assert [bool(each.deployment.cell) for each in stacked_arms(BOTH, own, ROOT)] == [True, False]
    shared = msgspec.structs.replace(common, cell=str(tmp_path / "cell.toml"))
    assert [each.deployment.cell for each in stacked_arms(BOTH, shared, ROOT)] == [shared.cell] * 2


def test_every_process_of_the_single_stack_runs_once_for_each_arm_and_router_broker_and_viewer_once(common):
    arms = stacked_arms(BOTH, common, ROOT)
    made = compose_of(SINGLE, arms, common, {})["processes"]
    once = {"router", "broker", "viewer", "about"}
    of_each = set(SINGLE["processes"]) - once - {"camera", "detector"}  # there is no cell
    assert set(made) == once | {f"{arm}-{name}" for arm in BOTH for name in of_each}
    assert set(made["about"]["depends_on"]) == set(made) - {"about"}
    given = " ".join(f"{name}={ROOT}/urdf/{name}" for name in BOTH)
    assert made["about"]["command"].endswith(f"deploy/welcome {given}")
    for name, process in made.items():
        assert set(process["depends_on"]) <= set(made) - {name}
    assert set(made["parol6-visualizer"]["depends_on"]) == {"router", "viewer"}


STATES = {
    "ready first": ('<group_state name="home" group="arm"><group_state group="arm" name="ready"/>', ("ready", "home")),
    "one alone": (
        '<!-- <group_state name="ready" group="arm"/> --><group_state group="arm"\n name="park"/>',
        ("park",),
    ),
    "with a blank": ('<group_state name="put it down" group="arm"/>', ("'put it down'",)),
}


@pytest.mark.parametrize(("text", "states"), STATES.values(), ids=STATES)
@pytest.mark.parametrize("several", [True, False])
def test_the_welcome_prints_moves_to_states_that_each_arm_has(tmp_path, text, states, several):
    """Of several arms: one has no state `ready`, or has it only in a comment."""
    folder = tmp_path / "mi brazo"
    folder.mkdir()
    (folder / "arm.srdf").write_text(f"<robot>{text}</robot>")
    bare = tmp_path / "bare"
    bare.mkdir()
    arguments = [f"rm1={ROOT}/urdf/rm1", f"mine={folder}", f"bare={bare}"] if several else []
    environment = {"PATH": os.environ["PATH"], "GEMELO_PATHS_OUT": str(tmp_path), "GEMELO_ROBOT": str(folder)}
    command = [ROOT / "deploy/welcome", *arguments]
    said = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
    moves = re.findall(r"gemelo (?:--robot (\w+) )?(move --named .*|jog)$", said, re.MULTILINE)
    own = [("mine" if several else "", f"move --named {state}") for state in states]
    others = [("rm1", "move --named ready"), ("rm1", "move --named home")] if several else []
    assert moves == others + own + ([("bare", "jog")] if several else [])


@pytest.mark.parametrize("several", [True, False])
def test_the_welcome_names_the_same_commands_and_places_in_spanish(tmp_path, several):
    arguments = [f"{name}={ROOT}/urdf/{name}" for name in BOTH] if several else []
    said = {}
    for locale in ("C.UTF-8", "es_MX.UTF-8"):
        environment = {"PATH": os.environ["PATH"], "GEMELO_PATHS_OUT": str(tmp_path), "LANG": locale}
        command = [ROOT / "deploy/welcome", *arguments]
        said[locale] = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
    english, spanish = (text.splitlines() for text in said.values())
    assert spanish[0].startswith("gemelo está en marcha")
    assert spanish[-1] == "  parar     Ctrl-C aquí (la TUI pregunta una vez más), o: make down"
    commands = re.compile(r"\.venv/bin/gemelo .*|[\w/.-]+/panel\.log|make down$")
    assert [commands.findall(line) for line in spanish] == [commands.findall(line) for line in english]


def test_what_would_only_stand_aside_is_left_out(common):
    bare = msgspec.structs.replace(
        common, device=DeviceKind.BOARD, viewer=msgspec.structs.replace(common.viewer, mode=ViewerMode.NONE)
    )
    made = compose_of(SINGLE, stacked_arms(BOTH, bare, ROOT), bare, {})["processes"]
    assert not {name for name in made if name.endswith(("viewer", "virtual_esp32"))}
    assert set(made["rm1-visualizer"]["depends_on"]) == {"router"}


def test_process_compose_takes_the_file_and_a_process_gets_its_arms_deployment_whatever_the_environment_says(
    tmp_path, monkeypatch
):
    environ = {
        "GEMELO_PATHS_RUN": str(tmp_path / "run $HOME"),
        "GEMELO_PANEL_PORT": "18088",
        "GEMELO_ROBOT": "urdf/rm1",
    }
    common = load_deployment(None, environ)
    file = write(stacked_arms(BOTH, common, ROOT), common, ROOT, environ)
    command = [ROOT / ".venv/bin/process-compose", "--dry-run", "-f", file]
    assert subprocess.run(command, cwd=ROOT, capture_output=True, check=False).returncode == 0
    made = yaml.safe_load(file.read_text())["processes"]["parol6-panel"]
    given = dict(each.replace("$$", "$").split("=", 1) for each in made["environment"])
    seen = load_deployment(None, {**environ, **given})
    assert seen.robot == str(ROOT / "urdf/parol6")
    assert seen.panel.port == 18089
    assert seen.paths.run == str(tmp_path / "run $HOME/parol6")


def test_every_arm_knows_all_that_share_its_view_in_the_order_of_their_pages(common):
    assert deployments_beside(common) == ()
    arms = stacked_arms(("rm1", "parol6"), common, ROOT)
    write(arms, common, ROOT, {})
    for each in arms:
        beside = deployments_beside(each.deployment)
        assert [robot_name(one) for one in beside] == ["rm1", "parol6"]
        assert each.deployment in beside


texts = st.text(st.characters(blacklist_categories=("Cc", "Cs", "Zl", "Zp", "Cf", "Co", "Cn")), max_size=20).filter(
    str.isprintable
)


@given(host=texts, out=texts, value=texts | st.booleans() | st.integers(-(2**40), 2**40))
def test_a_deployment_that_is_written_is_read_as_it_was(tmp_path_factory, host, out, value):
    made = Deployment(
        robot="/r", mqtt=MqttSection(host=host), paths=PathsSection(run="/r", out=f"/{out}", programs="/p"),
        parameters={"logger": {"log_dir": value}},
    )  # fmt: skip
    file = tmp_path_factory.getbasetemp() / "written.toml"
    file.write_text(deployment_file(made), encoding="utf-8")
    assert msgspec.convert(tomllib.loads(file.read_text(encoding="utf-8")), Deployment) == made


def test_the_command_line_finds_an_arms_deployment_until_one_arm_is_started_alone(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("GEMELO_PATHS_RUN", str(tmp_path / "run"))
    monkeypatch.setenv("GEMELO_VIEWER_MODE", "none")
    for section, port in zip(("ROUTER", "MQTT", "PANEL"), (17447, 11883, 18088), strict=True):
        monkeypatch.setenv(f"GEMELO_{section}_PORT", str(port))
    assert main(BOTH) == 0
    assert capsys.readouterr().out.strip() == str(file_of(load_deployment(), "process-compose").with_suffix(".json"))
    assert deployment_of_arm("parol6") == tmp_path / "run/arms/parol6.toml"
    assert deployment_of_arm("../arms/parol6") is None
    assert start_check() == 0
    assert deployment_of_arm("parol6") is None


def test_every_problem_is_a_line_and_nothing_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("GEMELO_PATHS_RUN", str(tmp_path / "run"))
    monkeypatch.setenv("GEMELO_PANEL_PORT", "7446")
    assert main(("rm1", "parol6", "rm1")) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) >= 2
    assert all(line.startswith("gemelo: ") for line in lines)
    assert not (tmp_path / "run").exists()
