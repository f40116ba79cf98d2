"""Arguments of xacro files, given on the command line or in a file of answers, and folders with several files."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.robot_import.source import find_source
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.robot_import.exports import joint

OPEN = '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">'
BOX = '<visual><geometry><box size="0.05 0.05 0.2"/></geometry></visual>'


def xacro_file(path: Path, *parts: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"{OPEN}{''.join(parts)}</robot>")
    return path


def variant(path: Path) -> Path:
    """An arm whose links have a prefix, and one with a longer chain where `long` is true."""
    return xacro_file(
        path, '<xacro:arg name="long" default="false"/>',
        *(f'<link name="$(arg prefix){name}">{BOX}</link>' for name in ("base", "upper")),
        joint("turn", "$(arg prefix)base", "$(arg prefix)upper", axis="0 0 1"),
        '<xacro:if value="$(arg long)">', f'<link name="fore">{BOX}</link>',
        joint("bend", "$(arg prefix)upper", "fore"), "</xacro:if>",
    )  # fmt: skip


def test_an_argument_without_a_default_is_asked_for_by_name(tmp_path: Path):
    with pytest.raises(DescriptionError, match=r"argument prefix has no default: give .* --xacro prefix:="):
        find_source(variant(tmp_path / "arm.xacro"))


def test_arguments_choose_the_variant_and_an_unknown_one_is_refused(tmp_path: Path):
    path = variant(tmp_path / "arm.xacro")
    assert '"fore"' not in find_source(path, {"prefix": "l_"}).text
    source = find_source(path, {"prefix": "l_", "long": "true"})
    assert '"fore"' in source.text
    assert '"l_base"' in source.text
    with pytest.raises(DescriptionError, match='no xacro argument "lnog"; did you mean "long"'):
        find_source(path, {"prefix": "", "lnog": "true"})


def test_a_plain_urdf_has_no_arguments(tmp_path: Path):
    path = tmp_path / "robot.urdf"
    path.write_text('<robot name="a"><link name="b"/></robot>')
    with pytest.raises(DescriptionError, match="it is no xacro file, and has no argument prefix"):
        find_source(path, {"prefix": ""})


def test_arguments_are_kept_in_the_file_of_answers(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path, folder = variant(tmp_path / "arm.xacro"), tmp_path / "urdf" / "arm"
    more = [str(path), "--yes", "--output", str(folder.parent)]
    assert run(["import", *more, "--xacro", "prefix:=l_", "--xacro", "long:=true"]) is ExitCode.OK, capsys.readouterr()
    answers = tomllib.loads((folder / "import.toml").read_text())
    assert (answers["xacro.prefix"], answers["xacro.long"]) == ("l_", "true")
    (folder / "robot.urdf").write_text("")
    assert run(["import", *more, "--force", "--answers", str(folder / "import.toml")]) is ExitCode.OK
    assert 'name="l_base"' in (folder / "robot.urdf").read_text()


def test_of_files_that_include_each_other_the_outermost_is_the_robot(tmp_path: Path):
    xacro_file(tmp_path / "urdf" / "hand.urdf.xacro", '<link name="hand"/>')
    xacro_file(
        tmp_path / "urdf" / "arm.urdf.xacro", '<xacro:include filename="hand.urdf.xacro"/>', '<link name="base"/>'
    )
    source = find_source(tmp_path)
    assert source.urdf.name == "arm.urdf.xacro"
    assert '"hand"' in source.text
