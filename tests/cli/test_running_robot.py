"""Commands and scripts speak with the robot that runs, whatever this terminal's environment says, on a real router."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from msgspec.structs import replace

import gemelo
from gemelo.libraries.arm.cell.cell_file import load_cell, read_cell_texts
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.libraries.runtime.started import chosen_name
from gemelo.schemas.cell import CellTexts
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import CELL, JOINT_STATES
from gemelo.tools.cli.camera.cells import cell_of
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.session import load_robot
from gemelo.tools.cli.main import run
from gemelo.tools.cli.watch import doctor
from tests.runtime.support import RouterProcess, spinning

ROOT = project_root()
CELL_FILE = ROOT / "urdf/rm1/cell.toml"


@pytest.fixture
def router(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[RouterProcess]:
    """A router that this terminal knows, and nothing else: neither robot nor cell nor folders."""
    made = RouterProcess(tmp_path)
    for name in ("GEMELO_ROBOT", "GEMELO_CELL", "GEMELO_CONFIG", "GEMELO_PATHS_RUN", "GEMELO_PATHS_OUT"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("GEMELO_ROUTER_PORT", str(made.port))
    monkeypatch.setenv("GEMELO_STARTED", str(tmp_path / "run/started.toml"))
    yield made
    made.kill()


def deployed(router: RouterProcess, robot: Path, cell: str = "", **changes: object) -> Deployment:
    return replace(router.deployment, robot=str(robot), cell=cell, **changes)


@contextmanager
def twin(router: RouterProcess, name: str, deployment: Deployment, node: str = "stepper_gateway") -> Iterator[Node]:
    """A node of a robot's twin, which answers what it was started with."""
    with Node(node, deployment, robot=name, stop=ShutdownRequest()) as made, spinning(made, rate=20.0):
        yield made


def test_the_only_robot_on_the_router_is_the_one_with_the_files_of_its_twin(router, tmp_path):
    elsewhere = tmp_path / "my own arm"
    shutil.copytree(ROOT / "urdf/parol6", elsewhere)
    with twin(router, "parol6", deployed(router, elsewhere, str(CELL_FILE))):
        found = load_robot()
    assert found.description.name == "parol6"
    assert found.deployment.robot == str(elsewhere)
    assert found.deployment.cell == str(CELL_FILE)
    assert (found.deployment.paths.run, found.deployment.paths.out) == (f"{tmp_path}/run", f"{tmp_path}/out")


def test_a_twin_without_a_cell_has_none_although_this_terminal_names_one(router, monkeypatch):
    monkeypatch.setenv("GEMELO_CELL", "urdf/rm1/cell.toml")
    with twin(router, "rm1", deployed(router, ROOT / "urdf/rm1")):
        assert load_robot().deployment.cell == ""


@pytest.mark.parametrize("command", [["node", "list"], ["topic", "list"], ["fk"]])
def test_no_command_refuses_because_another_robot_than_the_files_runs(router, command, capsys):
    with twin(router, "parol6", deployed(router, ROOT / "urdf/parol6")):
        run(command)
    said = capsys.readouterr()
    assert "has no rm1" not in said.err
    assert "start the twin" not in said.err


def test_of_several_none_is_guessed_and_all_are_named(router):
    with (
        twin(router, "rm1", deployed(router, ROOT / "urdf/rm1")),
        twin(router, "parol6", deployed(router, ROOT / "urdf/parol6")),
    ):
        with pytest.raises(CommandError) as refused:
            load_robot()
        assert f"2 robots run at 127.0.0.1:{router.port}: parol6, rm1" in str(refused.value)
        assert "`gemelo --robot parol6 ...`" in str(refused.value)
        assert "`gemelo use parol6`" in str(refused.value)
        with pytest.raises(gemelo.Error, match=r'Name one: gemelo\.connect\("parol6"\)'):
            gemelo.connect()
        with gemelo.connect("rm1") as arm:
            assert arm.name == "rm1"


def test_the_one_that_was_chosen_for_the_folder_is_it_among_several_and_not_alone(router, capsys):
    with twin(router, "parol6", deployed(router, ROOT / "urdf/parol6")):
        with twin(router, "rm1", deployed(router, ROOT / "urdf/rm1")):
            assert run(["use", "rm1"]) is ExitCode.OK
            assert chosen_name() == "rm1"
            assert load_robot().description.name == "rm1"
            assert "commands of this folder are for rm1" in capsys.readouterr().out
            assert run(["use", "rm2"]) is ExitCode.USAGE
            assert 'did you mean "rm1"?' in capsys.readouterr().err
            assert run(["use", "--none"]) is ExitCode.OK
            assert chosen_name() == ""
            run(["use", "rm1"])
        assert load_robot().description.name == "parol6"


def test_a_robot_that_is_named_is_never_exchanged_for_the_one_that_runs(router, monkeypatch, capsys):
    monkeypatch.setenv("GEMELO_ROBOT", "urdf/rm1")
    with twin(router, "parol6", deployed(router, ROOT / "urdf/parol6")):
        assert load_robot().description.name == "rm1"
        assert run(["request", "call", "fk"]) is ExitCode.NO_STACK
    assert "has no rm1, but parol6" in capsys.readouterr().err


def test_a_deployment_that_is_named_says_its_own_folders_and_cell(router, tmp_path, monkeypatch):
    """As of a person on a host of a site, who may not write where its services do."""
    own = tmp_path / "own.toml"
    own.write_text(
        f'robot = "urdf/rm1"\ncell = "{CELL_FILE}"\n[router]\nport = {router.port}\n'
        f'[paths]\nrun = "{tmp_path}/mine"\nout = "{tmp_path}/mine"\n'
    )
    monkeypatch.setenv("GEMELO_CONFIG", str(own))
    with twin(router, "rm1", deployed(router, ROOT / "urdf/rm1")):
        found = load_robot().deployment
    assert (found.paths.run, found.paths.out, found.cell) == (f"{tmp_path}/mine", f"{tmp_path}/mine", str(CELL_FILE))


def test_a_robot_whose_folder_is_elsewhere_is_named_by_its_name(router, tmp_path, monkeypatch):
    folder = tmp_path / "left arm"
    shutil.copytree(ROOT / "urdf/rm1", folder)
    file = folder / "robot.toml"
    file.write_text(file.read_text().replace('name = "rm1"', 'name = "left"', 1))
    with twin(router, "left", deployed(router, folder)):
        with gemelo.connect("left") as arm:
            assert arm.name == "left"
        monkeypatch.setenv("GEMELO_ROBOT", "")  # so that the test's own environment is as before
        assert run(["--robot", "left", "fk"]) is not ExitCode.USAGE


def test_a_node_of_a_script_is_on_the_bus_of_the_robot_that_runs(router):
    with twin(router, "parol6", deployed(router, ROOT / "urdf/parol6")) as gateway:
        gateway.publisher(JOINT_STATES)
        with Node("joint_monitor", stop=ShutdownRequest()) as node:
            assert node.robot == "parol6"
            joints = node.latest(JOINT_STATES)
            end = node.monotonic() + 60.0
            while joints.message is None and node.monotonic() < end:
                gateway.publisher(JOINT_STATES).put(JointState(name=("joint_1",), position=(0.5,)))
                node.wait(0.05)
            assert joints.message is not None


def test_a_script_waits_for_whatever_robot_comes(router):
    with twin(router, "parol6", deployed(router, ROOT / "urdf/parol6")), gemelo.connect(timeout=60.0) as arm:
        assert arm.name == "parol6"
    with pytest.raises(gemelo.Lost, match="no stepper_gateway of rm1"):
        gemelo.connect(timeout=0.3)


def test_a_cell_of_another_machine_comes_over_the_bus(router, tmp_path):
    texts = read_cell_texts(CELL_FILE)
    with twin(router, "rm1", deployed(router, ROOT / "urdf/rm1"), "camera") as camera:
        camera.publisher(CELL).put(replace(texts, path="/far/away/cell.toml"))
        robot = load_robot()
        assert robot.deployment.cell == ""  # no file of this machine
        cell = cell_of(robot)
    assert cell.camera_names == load_cell(CELL_FILE, robot.description).camera_names
    assert cell.things
    assert cell.places
    assert str(cell.path) == "/far/away/cell.toml"


def test_a_twin_without_a_cell_is_said_to_have_none_and_not_this_terminal(router):
    with (
        twin(router, "rm1", deployed(router, ROOT / "urdf/rm1")),
        twin(router, "rm1", deployed(router, ROOT / "urdf/rm1"), "camera") as camera,
    ):
        camera.publisher(CELL).put(CellTexts())
        with gemelo.connect() as arm, pytest.raises(gemelo.Refused) as refused:
            arm.detect()
    assert "the twin of rm1 was started without a cell file" in str(refused.value)


def test_doctor_says_what_runs_with_which_files(router):
    with twin(router, "parol6", deployed(router, ROOT / "urdf/parol6", str(CELL_FILE))):
        (found,) = doctor.runs(router.deployment.router)
        assert doctor.deployment_here().robot == str(ROOT / "urdf/parol6")
    assert found.subject == "runs parol6"
    assert f"{ROOT}/urdf/parol6 on " in found.found
    assert f"with {CELL_FILE}" in found.found
