"""Refusals of an import, all at once; and a person's answers to it: motors, answers, --force."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import pytest
import trimesh

from gemelo.libraries.arm.checks.check import check
from gemelo.libraries.arm.checks.findings import Severity
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.robot_import.limits import ask_limits
from gemelo.libraries.robot_import.mending import mend
from gemelo.libraries.robot_import.questions import Questions
from gemelo.libraries.robot_import.source import find_source
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.robot_import.exports import by_hand, joint, link, mesh, package, solidworks, workspace, write


def broken(root: Path) -> Path:
    """An export whose faults have no one answer."""
    folder = package(root / "broken_description", "broken_description")
    mesh(folder / "meshes", "base_link.STL")
    (folder / "meshes" / "arm.STL").write_bytes(b"no mesh at all")
    write(
        folder / "urdf" / "broken.urdf", "broken",
        link("base_link", "package://broken_description/meshes/base_link.STL"),
        link("arm", "package://broken_description/meshes/arm.STL"),
        link("hand", "package://broken_description/meshes/base_lnik.STL"),
        '<link name="loose"/>',
        joint("one", "base_link", "arm", axis="0 0 0"),
        joint("two", "arm", "hnad", rest='<limit lower="-1" upper="1,5" effort="1" velocity="1"/>'),
        joint("three", "arm", "hand", kind="planar"),
    )  # fmt: skip
    return folder


FAULTS = (
    ("line 7", 'joint "one"', "the axis is zero"),
    ("line 8", 'joint "two"', '"1,5" is not a number', 'write "1.5"'),
    ("line 8", 'joint "two"', '"hnad" is no link', '"hand"'),
    ("line 9", 'joint "three"', 'type "planar"'),
    ("has 2 roots", "loose", "join them with a fixed joint"),
    ('link "hand"', "base_lnik.STL", "is not there", '"base_link.STL"'),
    ('link "arm"', "arm.STL", "it holds no triangle", "export it again"),
)


@pytest.mark.parametrize("words", [["import"], ["check"]])
def test_everything_that_is_wrong_is_said_at_once_by_import_and_by_check(
    tmp_path: Path, words: list[str], capsys: pytest.CaptureFixture[str]
):
    source = broken(tmp_path)
    more = ["--output", str(tmp_path / "urdf"), "--yes"] if words == ["import"] else []
    assert run([*words, str(source), *more]) is ExitCode.FAILED
    said = [line for line in capsys.readouterr().out.splitlines() if line.startswith("error: ")]
    for fault in FAULTS:
        assert any(all(word in line for word in fault) for line in said), (fault, said)
    assert not (tmp_path / "urdf").exists()


def test_check_of_a_bare_urdf_and_of_its_folder_says_what_import_mends(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    urdf = by_hand(tmp_path).source
    for given in (urdf, tmp_path):
        assert run(["check", str(given)]) is ExitCode.OK
        said = capsys.readouterr().out
        assert "its mass is 0 kg: it is a mere frame -> <inertial> left out" in said
        assert f"{given}: all is well" in said
    assert run(["check", str(solidworks(tmp_path / "sw").source)]) is ExitCode.OK
    said = capsys.readouterr().out
    assert "its limits lack sense (lower 0, upper 0, velocity 0, effort 0) -> lower=" in said
    assert "by default: correct it in robot.urdf" in said


def test_a_folder_without_a_robot_or_with_several_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    for words, text in (
        (["import", str(tmp_path)], "there is no .urdf and no .xacro"),
        (["check", str(tmp_path / "nobody")], "there is no such file or folder"),
    ):
        assert run(words) is ExitCode.FAILED
        assert text in capsys.readouterr().err
    write(tmp_path / "a.urdf", "a", link("x"))
    write(tmp_path / "b.urdf", "b", link("x"))
    assert run(["import", str(tmp_path)]) is ExitCode.FAILED
    assert "there are 2 robots in it (a.urdf, b.urdf): name one" in capsys.readouterr().err


def test_xacro_without_its_package_says_what_would_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setitem(sys.modules, "xacro", None)
    file = tmp_path / "arm.urdf.xacro"
    file.write_text('<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arm prefix="l"/></robot>')
    for given in (file, tmp_path):
        assert run(["import", str(given)]) is ExitCode.FAILED
        assert "the Python package `xacro` is not installed: run `make setup`" in capsys.readouterr().err


PARTS = (
    '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="length" value="0.2"/>'
    '<xacro:macro name="part" params="name"><link name="${name}"><visual><geometry>'
    '<box size="0.05 0.05 ${length}"/></geometry></visual></link></xacro:macro></robot>'
)


def xacro_package(folder: Path, package: str) -> Path:
    """A ROS package whose robot includes its macros by `$(find package)`: the robot's file."""
    (folder / "urdf").mkdir(parents=True)
    (folder / "package.xml").write_text("<package><name>arm_description</name></package>")
    (folder / "urdf/parts.xacro").write_text(PARTS)
    robot = folder / "urdf/arm.urdf.xacro"
    robot.write_text(
        '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">'
        f'<xacro:include filename="$(find {package})/urdf/parts.xacro"/>'
        '<xacro:part name="one"/><xacro:part name="two"/>' + joint("turn", "one", "two") + "</robot>"
    )
    return robot


def test_xacro_is_expanded_with_the_packages_beside_it(tmp_path: Path):
    robot = xacro_package(tmp_path / "any name", "arm_description")
    for number, given in enumerate((tmp_path, robot)):
        output = tmp_path / f"urdf{number}"
        assert run(["import", str(given), "--yes", "--output", str(output)]) is ExitCode.OK
        assert load_arm(output / "arm").joint_names == ("turn",)


def test_xacro_that_cannot_be_expanded_says_what_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    robot = xacro_package(tmp_path / "arm", "other_description")
    assert run(["import", str(robot)]) is ExitCode.FAILED
    said = capsys.readouterr().err
    assert f'there is no package "other_description" in {robot.parent}, {robot.parent.parent},' in said
    assert said.count("there is no package") == 1  # xacro's own wrapping says it twice
    robot.write_text(robot.read_text().replace("other_description", "arm").replace('"one"', '"${nobody}"'))
    assert run(["import", str(robot)]) is ExitCode.FAILED
    said = capsys.readouterr().err
    assert "arm.urdf.xacro: xacro cannot expand it" in said
    assert "nobody" in said


def test_motors_are_written_with_their_sources_and_what_was_answered_and_the_speeds_that_follow(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """Also: with --answers the same robot is written again to the byte, and a switch homes its joint."""
    source, output = str(by_hand(tmp_path / "source").source), tmp_path / "urdf"
    words = ["import", source, "--output", str(output), "--name", "arm"]
    assert run([*words, "--motor", "nema 23", "--driver", "dm542", "--yes"]) is ExitCode.OK
    said = capsys.readouterr().out
    assert 'joint "joint1": 19.1 RPM are 509 steps/s, 509 steps/s^2; DM542 takes 200000 steps/s (0% used)' in said
    assert "at a tick of 20 us (50 kHz" in said
    arm = load_arm(output / "arm")
    assert arm.has_motors
    assert {driver.name for driver in arm.drivers} == {"DM542"}
    assert "# Leadshine DM542 manual" in (output / "arm" / "robot.toml").read_text()
    assert "NEMA ICS 16" in (output / "arm" / "robot.toml").read_text()

    answers = output / "arm" / "import.toml"
    text = answers.read_text()
    for key, value in (
        ("joint1.switch", "lower"),
        ("joint2.ratio", "380/21"),
        ("joint2.step_pin", "2"),
        ("joint2.dir_pin", "15"),
        ("joint2.inverted", "yes"),
        ("joint2.microsteps", "20"),
        ("finger1.motor", "28BYJ-48"),
    ):
        assert f'"{key}"' in text
        old = tomllib.loads(text)[key]
        text = text.replace(f'"{key}" = "{old}"', f'"{key}" = "{value}"')
    mine = tmp_path / "mine.toml"
    mine.write_text(f'{text}"joint1.switch_pin" = 34\n')
    assert run([*words, "--answers", str(mine), "--yes"]) is ExitCode.FAILED
    assert "give --force" in capsys.readouterr().err
    assert run([*words, "--answers", str(mine), "--yes", "--force"]) is ExitCode.OK
    arm = load_arm(output / "arm")
    homing, switch = arm.joint("joint1").drive.homing, arm.joint("joint1").drive.homing.switch
    assert homing.direction == "lower"
    assert [(each.pin, each.joint) for each in arm.inputs if each.name == switch] == [(34, "joint1")]
    assert arm.joint("joint2").drive.homing is None  # its place is declared: `gemelo reference`
    motor = arm.joint("joint2").drive.motor
    assert (motor.gear_ratio, motor.step_pin, motor.dir_pin, motor.inverted) == ("380/21", 2, 15, True)
    assert motor.pulses_per_turn == 200 * 20
    assert arm.joint("finger1").drive.motor.gear_ratio == "25792/405"
    assert [finding for finding in check(arm.folder) if finding.severity is Severity.ERROR] == []

    again = [*words[:2], "--output", str(tmp_path / "again"), "--name", "arm"]
    assert run([*again, "--answers", str(arm.folder / "import.toml")]) is ExitCode.OK  # nobody is asked
    assert contents(tmp_path / "again" / "arm") == contents(arm.folder)


def contents(folder: Path) -> dict[Path, bytes]:
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ('"motor" = "nema 17"', 'nothing asks for "motor"; did you mean "motors"'),
        ('"motors" = "perhaps"', 'motors = "perhaps": say yes or no'),
        ('"tool_frame" = "hand"', 'tool_frame = "hand": no such link'),
        ('"motors" = "yes"\n"joint1.motor" = "NEMA 99"', 'no motor "NEMA 99" in the table: there is NEMA 17'),
        ('"motors" = "yes"\n"joint1.microsteps" = "7"', "TMC2209 does 8, 16, 32, 64"),
        ('"motors" = "yes"\n"joint1.ratio" = "4,7"', "neither a decimal nor a fraction"),
    ],
)
def test_a_wrong_answer_is_refused_with_what_would_do(
    tmp_path: Path, line: str, text: str, capsys: pytest.CaptureFixture[str]
):
    (tmp_path / "answers.toml").write_text(line)
    source = str(by_hand(tmp_path / "source").source)
    words = ["import", source, "--output", str(tmp_path / "urdf"), "--answers", str(tmp_path / "answers.toml"), "--yes"]
    assert run(words) is ExitCode.FAILED
    assert text in capsys.readouterr().err
    assert not (tmp_path / "urdf").exists()


def test_where_nobody_can_be_asked_it_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert run(["import", str(by_hand(tmp_path).source), "--output", str(tmp_path / "urdf")]) is ExitCode.FAILED
    assert "there is nobody to ask for tool_frame: say --yes for the defaults" in capsys.readouterr().err
    assert not (tmp_path / "urdf").exists()


def test_the_source_itself_is_never_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    source = workspace(tmp_path / "arm").source.parent
    assert (
        run(["import", str(source), "--output", str(tmp_path), "--name", "arm", "--yes", "--force"]) is ExitCode.FAILED
    )
    assert "which is to be replaced: give --name" in capsys.readouterr().err
    assert (source / "src").is_dir()


def test_a_material_that_nothing_colours_is_left_out_and_said_once(tmp_path: Path):
    """As exporters write them; each reader would complain of each use of it."""
    visual = "<visual><geometry><box size='0.1 0.1 0.1'/></geometry><material name='{}'/></visual>"
    path = tmp_path / "plain.urdf"
    path.write_text(
        '<robot name="plain"><material name="red"><color rgba="1 0 0 1"/></material><material name="black"><color/>'
        f"</material><link name='one'>{visual.format('black')}{visual.format('red')}{visual.format('nobodys')}</link>"
        f"<link name='two'>{visual.format('black')}</link></robot>",
        encoding="utf-8",
    )
    mended = mend(find_source(path))
    assert [material.get("name") for material in mended.xml.root.iter("material")] == ["red", "red"]
    said = [note.subject for note in mended.notes if "colour" in note.message]
    assert said == ['material "black"', 'material "nobodys"']


@pytest.mark.parametrize("scale", ["", ' scale="0.001 0.001 0.001"'])
def test_a_mesh_that_stands_for_nothing_is_left_out_and_one_that_is_scaled_to_nothing_is_an_error(
    tmp_path: Path, scale: str
):
    size = 0.0002 if not scale else 0.2
    trimesh.creation.box((size, size, size)).export(tmp_path / "tiny.stl")
    path = tmp_path / "small.urdf"
    shape = f"<visual><geometry><mesh filename='tiny.stl'{scale}/></geometry></visual>"
    path.write_text(f"<robot name='small'><link name='base'>{shape}</link></robot>", encoding="utf-8")
    mended = mend(find_source(path))
    errors = [each.message for each in mended.findings() if each.severity is Severity.ERROR]
    assert bool(scale) == any("0.2 mm long" in message for message in errors)
    assert (mended.xml.root.find("link/visual") is None) == (not scale)


def test_a_wrist_of_two_turns_each_way_keeps_its_limits_however_they_are_rounded(tmp_path: Path):
    path = tmp_path / "wrist.urdf"
    moves = joint("wrist", "one", "two", rest='<limit lower="-6.28319" upper="6.28319" effort="1" velocity="1"/>')
    path.write_text(f'<robot name="wrist"><link name="one"/><link name="two"/>{moves}</robot>', encoding="utf-8")
    mended = mend(find_source(path))
    ask_limits(mended, Questions({}, takes_defaults=True))
    assert mended.model.joints[0].limit.lower == -6.28319  # type: ignore[union-attr]
    assert not [each for each in mended.findings() if each.subject == 'joint "wrist"']


def test_force_replaces_a_robot_and_nothing_else(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    kept = tmp_path / "urdf" / "arm" / "thesis.txt"
    kept.parent.mkdir(parents=True)
    kept.write_text("three years")
    source = str(by_hand(tmp_path / "source").source)
    words = ["import", source, "--output", str(tmp_path / "urdf"), "--name", "arm", "--yes", "--force"]
    assert run(words) is ExitCode.FAILED
    assert "is no robot's folder, --force does not replace it: give --name" in capsys.readouterr().err
    assert kept.read_text() == "three years"
