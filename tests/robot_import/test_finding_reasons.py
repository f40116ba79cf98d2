"""Tests of the findings of an import: each real cause has its code, values and remedy, and a sentence in a language."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from gemelo.libraries.arm.checks.findings import Finding, Severity
from gemelo.libraries.arm.errors import DescriptionError, Subject
from gemelo.libraries.arm.model.virtual_drive import device_name
from gemelo.libraries.robot_import.questions import BadAnswer, Questions
from gemelo.libraries.robot_import.source import find_source
from gemelo.libraries.robot_import.survey import surveyed
from gemelo.schemas.reasons import PLAIN, Reason, because, remedy, say
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.robot_import.plain_arm import APART, LIMIT, LINKS, arm, body, boxes, hinge, hinges, meshed, part, stl
from tests.robot_import.test_sizes_and_places import assembled, in_unit
from tests.robot_import.test_what_restricts_motion import LIMITS, SAFETY, SRDF

LEFT_OUT = remedy("left_out")
ALL = 'lower="-3.14159" upper="3.14159" velocity="1" effort="10"'
MIDDLE = '<origin xyz="0 0 0.1" rpy="0 0 0"/>'
INERTIA = '<mass value="0.5"/><inertia ixx="{}" iyy="0.002" izz="0.001" ixy="0" ixz="0" iyz="0"/>'
SOFT = {"low": -1.0, "high": 1.0, "lower": -2.0, "upper": 2.0}


def findings(source: Path, **given: str) -> list[Finding]:
    return surveyed(find_source(source), Questions(given, takes_defaults=True)).findings


def joint(text: str) -> Callable[[Path], Path]:
    """The arm with `text` in its last joint."""
    return lambda folder: arm(folder, boxes(), hinges(j3=text))


def link(text: str) -> Callable[[Path], Path]:
    """The arm with `text` in its last link but one."""
    return lambda folder: arm(folder, boxes(fore=text), hinges())


def beside(name: str, text: str) -> Callable[[Path], Path]:
    """The arm, and a file beside it."""

    def make(folder: Path) -> Path:
        source = arm(folder)
        (folder / name).write_text(text)
        return source

    return make


def massive(inertia: str, xyz: str = "0 0 0.1") -> str:
    return f'<inertial><origin xyz="{xyz}"/>{INERTIA.format(inertia)}</inertial>{body("visual")}{body("collision")}'


def near_mesh(folder: Path) -> Path:
    stl(folder / "forearm.stl")
    return arm(folder, boxes(fore=meshed("fore_arm.stl")), hinges())


def of_one_link(folder: Path) -> Path:
    return arm(folder, boxes(), *(hinge(f"j{n}", LINKS[n - 1], LINKS[n], "", kind="fixed") for n in (1, 2, 3)))


CAUSES: dict[str, tuple[Callable[[Path], Path], Severity, Subject, Reason]] = {
    "no limit": (
        joint(""), Severity.WARNING, Subject("joint", "j3"),
        because("mend.limits", remedy("written_by_default", text=ALL), was=("lower", "upper", "velocity", "effort")),
    ),
    "no velocity": (
        joint(LIMIT.replace('velocity="1"', 'velocity="0"')), Severity.WARNING, Subject("joint", "j3"),
        because("mend.limits", remedy("written_by_default", text='velocity="1"'), was=("velocity 0",)),
    ),
    "locked": (
        joint(LIMIT.replace('"-2"', '"0.5"').replace('"2"', '"0.5"')), Severity.WARNING, Subject("joint", "j3"),
        because("mend.joint.locked", remedy("fixed_there"), place=0.5, unit="rad"),
    ),
    "soft limits": (
        joint(LIMIT + SAFETY.format("-1", "1")), Severity.NOTE, Subject("joint", "j3"),
        because("mend.soft.within", remedy("written", text='lower="-1" upper="1"'), **SOFT),
    ),
    "one soft limit": (
        joint(LIMIT + '<safety_controller soft_lower_limit="-1"/>'), Severity.NOTE, Subject("joint", "j3"),
        because("mend.soft.within", remedy("written", text='lower="-1" upper="2"'), **{**SOFT, "high": "none"}),
    ),
    "soft limits beyond": (
        joint(LIMIT + SAFETY.format("5", "6")), Severity.WARNING, Subject("joint", "j3"),
        because("mend.soft.no_travel", remedy("left_out_correct_them"), **{**SOFT, "low": 5.0, "high": 6.0}),
    ),
    "a mark": (
        joint(LIMIT + '<calibration rising="0.1"/>'), Severity.NOTE, Subject("joint", "j3"),
        because("mend.calibration", remedy("left_out_reference"), element='<calibration rising="0.1">'),
    ),
    "capital letters": (
        lambda folder: arm(folder, boxes(), hinges().replace('"j3" type="revolute"', '"j3" type="Revolute"')),
        Severity.NOTE, Subject("joint", "j3"),
        because("mend.capitals", remedy("written", text='type="revolute"'), type="Revolute"),
    ),
    "a long axis": (
        lambda folder: arm(folder, boxes(), hinges().replace('xyz="0 0 1"', 'xyz="0 0 2"')),
        Severity.NOTE, Subject("joint", "j1"),
        because("mend.axis", remedy("written", text='xyz="0 0 1"'), axis="0 0 2", length=2.0),
    ),
    "a minus of print": (
        joint(LIMIT.replace("-2", "\u22122")), Severity.NOTE, Subject("<limit>"),
        because("mend.minuses", remedy("written", text='"-2"'), text="\u22122", count=1),
    ),
    "a name with a blank": (
        lambda folder: arm(folder, boxes().replace("hand", "left hand"), hinges().replace("hand", "left hand")),
        Severity.NOTE, Subject("link", "left hand"), because("mend.name", remedy("written", text="left_hand")),
    ),
    "of a simulator": (
        lambda folder: arm(folder, boxes(), hinges(), "<gazebo/>", "<gazebo/>"), Severity.NOTE, Subject("<gazebo>"),
        because("mend.unused", LEFT_OUT, count=2),
    ),
    "no mass": (
        link(massive("0.002").replace('value="0.5"', 'value="0"')), Severity.NOTE, Subject("link", "fore"),
        because("mend.link.frame", remedy("inertial_left_out")),
    ),
    "a mass in another frame": (
        link(massive("0.002", "0 0 0.5")), Severity.NOTE, Subject("link", "fore"),
        because("mend.mass.assembly", remedy("written", text=MIDDLE), gap=0.3),
    ),
    "a mass beside it": (
        link(massive("0.002", "0.7 0 0.1")), Severity.NOTE, Subject("link", "fore"),
        because("mend.mass.middle", remedy("written", text=MIDDLE), gap=0.675),
    ),
    "only touched": (
        link(body("collision")), Severity.NOTE, Subject("link", "fore"),
        because("mend.link.unseen", remedy("drawn_with_the_same")),
    ),
    "only drawn": (
        link(body("visual")), Severity.WARNING, Subject("link", "fore"),
        because("urdf.link.untouched", remedy("shapes_for_drawn")),
    ),
    "touched beside": (
        link(body("visual") + body("collision", xyz="0.5 0 0.1")), Severity.NOTE, Subject("link", "fore"),
        because("mend.place.beside.alike", remedy("written_as_visual", text=MIDDLE), gap=0.45),
    ),
    "no shapes": (
        lambda folder: arm(folder, *(part(name, "") for name in LINKS), hinges()), Severity.WARNING,
        Subject("robot"), because("mend.robot.no_shape", remedy("rods_instead", thickness=0.05 * APART)),
    ),
    "no joint that moves": (
        of_one_link, Severity.ERROR, Subject("robot"), because("mend.robot.no_joint", remedy("name_another_file")),
    ),
    "a long name": (
        lambda folder: arm(folder, boxes(), hinges(), name="arm_" * 9), Severity.NOTE, Subject("robot"),
        because("mend.robot.name", remedy("device_is_named", device=device_name("arm_" * 8 + "arm")),
                name="arm_" * 8 + "arm", letters=35, most=31),
    ),
    "an SRDF of another": (
        beside("other.srdf", SRDF.format(name="other", more="")), Severity.WARNING, Subject(within="other.srdf"),
        because("mend.srdf.other_robot", LEFT_OUT, other="other", robot="arm"),
    ),
    "a state beyond its limits": (
        beside("arm.srdf", SRDF.format(name="arm", more="")), Severity.WARNING,
        Subject("state", "far", within="arm.srdf"),
        because("mend.srdf.limits", LEFT_OUT, joint="j3", value=2.7, lower=-2.0, upper=2.0),
    ),
    "a passive joint": (
        beside("arm.srdf", SRDF.format(name="arm", more='<passive_joint name="j2"/>')), Severity.WARNING,
        Subject("passive_joint", within="arm.srdf"),
        because("mend.srdf.passive", remedy("passive_stand_still"), joints=("j2",)),
    ),
    "what an SRDF gives": (
        beside("arm.srdf", SRDF.format(name="arm", more="")), Severity.NOTE, Subject("robot", within="arm.srdf"),
        because("mend.srdf.taken", remedy("taken_into_srdf"), groups=3, states=3, pairs=1),
    ),
    "MoveIt's limits": (
        beside("joint_limits.yaml", LIMITS), Severity.NOTE, Subject("joint", "j1"),
        because("mend.moveit.further",
                remedy("written_with_ramp", text='velocity="0.5"', acceleration=0.25, unit="rad/s^2"),
                file="joint_limits.yaml"),
    ),
    "MoveIt's limit of another joint": (
        beside("joint_limits.yaml", LIMITS), Severity.WARNING, Subject(within="joint_limits.yaml"),
        because("mend.moveit.joint", LEFT_OUT, joint="j9"),
    ),
    "MoveIt's jerk": (
        beside("joint_limits.yaml", LIMITS), Severity.NOTE, Subject("joint", "j3"),
        because("mend.moveit.quantity", LEFT_OUT, file="joint_limits.yaml", quantity="jerk", value=3.0),
    ),
    "no limits in the file of MoveIt": (
        beside("joint_limits.yaml", "joints: []"), Severity.WARNING, Subject(within="joint_limits.yaml"),
        because("mend.moveit.no_limits", remedy("left_out_file", file="FOLDER/joint_limits.yaml")),
    ),
    "a mesh of another name": (
        near_mesh, Severity.ERROR, Subject("link", "fore"),
        because("mend.mesh.near", remedy("put_below", folder="FOLDER"), mesh="fore_arm.stl", name="forearm.stl"),
    ),
    "no mesh at all": (
        link(meshed("gone.stl")), Severity.ERROR, Subject("link", "fore"),
        because("mend.mesh.none_at_all", remedy("put_below", folder="FOLDER"), mesh="gone.stl", folder="FOLDER"),
    ),
    "no mesh to look at": (
        link(meshed("gone.stl", tags=("visual",)) + body("collision")), Severity.WARNING, Subject("link", "fore"),
        because("mesh.none", remedy("left_out_drawn_with_collision"), mesh="gone.stl"),
    ),
    "meshes in millimetres": (
        lambda folder: in_unit(folder, "mm", APART), Severity.NOTE, Subject("link", "base"),
        because("mend.mesh.unit",
                because("mend.mesh.long.several", mesh="u.stl", length=200.0, span=APART, count=4, tag="visual"),
                remedy("written", text='scale="0.001 0.001 0.001"'), unit="mm"),
    ),
    "meshes in no unit": (
        lambda folder: in_unit(folder, "m", 2000.0), Severity.ERROR, Subject("link", "base"),
        because("mend.mesh.no_unit",
                because("mend.mesh.long.several", mesh="u.stl", length=2000.0, span=APART, count=4, tag="visual"),
                remedy("correct_or_answer_one", key="visual_mesh_unit", answer="m",
                       answers=("m", "mm", "cm", "in", "as_written"))),
    ),
    "meshes in the frame of the assembly": (
        assembled, Severity.NOTE, Subject("link", "hand"),
        because("mend.place.assembly.away", remedy("written", text='<origin xyz="0 0 -0.6" rpy="0 0 0"/>'), gap=0.6),
    ),
    "meshes beside their joints": (
        lambda folder: assembled(folder, 0.85), Severity.ERROR, Subject("link", "base"),
        because("mend.place.away", remedy("correct_or_answer", key="mesh_places", answer="as_written"), gap=0.825),
    ),
}  # fmt: skip


def rounded(reason: Reason, folder: Path) -> str:
    """As it travels, with four digits of each number, and FOLDER for the folder of the test."""
    text = msgspec.json.encode(reason).decode().replace(str(folder), "FOLDER")
    return re.sub(r"-?\d+\.\d+(e-?\d+)?", lambda found: f"{float(found[0]):.4g}", text)


@pytest.mark.parametrize(("make", "severity", "subject", "reason"), CAUSES.values(), ids=list(CAUSES))
def test_each_cause_has_its_code_values_and_remedy(
    tmp_path: Path, make: Callable[[Path], Path], severity: Severity, subject: Subject, reason: Reason
):
    found = findings(make(tmp_path))
    named = [rounded(each.what, tmp_path) for each in found if (each.severity, each.of) == (severity, subject)]
    assert rounded(reason, tmp_path) in named


def test_no_finding_of_a_source_is_a_plain_sentence(tmp_path: Path):
    """In neither language: nothing of what is found comes without a code, its subject and its remedy too."""
    for number, (make, *_) in enumerate(CAUSES.values()):
        for each in findings(make(tmp_path / str(number))):
            parts = (each.reason, *each.reason.causes, each.what, *each.what.causes)
            assert PLAIN not in [part.code for part in (*parts, *each.what.remedies)], str(each)
            assert say(each.reason, "es") != str(each)


def test_the_sentences_are_those_of_each_language(tmp_path: Path):
    (found,) = (each for each in findings(in_unit(tmp_path, "cm", 0.7 * APART)) if "<visual>" in str(each))
    assert say(found.reason, "es") in (
        "error: arm.urdf, línea 3: eslabón «base»: la malla «u.stl» mide 14 m, donde las articulaciones distan hasta "
        f"0.2 m, como están escritas 4 mallas de <visual>: podrían ser {units} -> corríjalo en el archivo de origen, o "
        'escriba visual_mesh_unit = "m" (m, mm, cm, in, as_written) en un archivo para `gemelo import --answers`'
        for units in ("centímetros y pulgadas", "pulgadas y centímetros")
    )
    (soft,) = findings(joint(LIMIT + '<safety_controller soft_lower_limit="-1"/>')(tmp_path / "soft"))
    assert str(soft).endswith('its soft limits -1 to none are within its limits -2 to 2 -> lower="-1" upper="2"')
    assert "sus límites blandos, de -1 a ninguno, están dentro" in say(soft.reason, "es")


def test_a_joint_whose_name_is_a_number_is_named_as_a_joint(tmp_path: Path):
    found = findings(arm(tmp_path, boxes(), hinges(j3="").replace('"j3"', '"3"')))
    assert any(str(each).startswith('warning: arm.urdf, line 9: joint "3": its limits') for each in found)


def test_an_answer_about_joints_or_links_that_are_none_says_why(tmp_path: Path):
    with pytest.raises(DescriptionError) as caught:
        findings(arm(tmp_path), tool_frame="hands")
    near = because("import.answer.no_link", remedy("did_you_mean", name="hand"))
    assert caught.value.reason == because("import.answer", near, key="tool_frame", text="hands")
    with pytest.raises(DescriptionError) as wrong:
        surveyed(find_source(arm(tmp_path)), Questions({}, takes_defaults=True), motor="NEMA 18")
    known = ("NEMA 17", "NEMA 23", "28BYJ-48")
    assert wrong.value.reason == because("import.answer.motor", text="NEMA 18", names=known)
    assert issubclass(BadAnswer, ValueError)


def test_an_import_speaks_the_language_of_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    source = arm(tmp_path, boxes(fore=meshed("gone.stl")), hinges(), "<gazebo/>")
    assert run(["--lang", "es", "import", str(source), "--yes", "--output", str(tmp_path)]) is ExitCode.FAILED
    printed = capsys.readouterr()
    first, *lines = printed.out.splitlines()
    assert first == "lectura del archivo de origen y sus mallas ..."
    assert lines[0].startswith("error: arm.urdf, línea 5: eslabón «fore»: la malla «gone.stl» no está; no hay ninguna")
    nothing = "nada de lo que dice se usa aquí (1 en total) -> se omite"
    assert lines[-1] == f"corregido: arm.urdf, línea 10: <gazebo>: {nothing}"
    assert "el error de arriba no tiene una sola respuesta" in printed.err.lower()
