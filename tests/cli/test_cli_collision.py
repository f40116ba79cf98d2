"""`gemelo collision fit` and `gemelo collision matrix` on robots' folders."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from gemelo.libraries.arm.model.srdf_edit import entries
from gemelo.libraries.arm.model.urdf import read_urdf
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run


@pytest.fixture
def folder(tmp_path: Path, rm1_folder: Path) -> Path:
    """A robot that may be changed."""
    shutil.copytree(rm1_folder, tmp_path / "rm1")
    return tmp_path / "rm1"


def test_the_shipped_robot_needs_no_change(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = (folder / "robot.srdf").read_bytes()
    assert run(["collision", "matrix", str(folder), "--write"]) is ExitCode.OK
    assert "nothing to change" in capsys.readouterr().out
    assert (folder / "robot.srdf").read_bytes() == before


def test_what_is_missing_or_wrong_is_said_and_written_only_when_asked(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    srdf = folder / "robot.srdf"
    text = srdf.read_text()
    wrong = text.replace('link1="base_link" link2="brazo_link"', 'link1="base_link" link2="efector_link"')
    wrong = wrong.replace('link2="antebrazo_link" reason="Never"', 'link2="antebrazo_link" reason="A person\'s"')
    srdf.write_text(wrong)
    assert run(["collision", "matrix", str(folder)]) is ExitCode.OK
    said = capsys.readouterr().out
    assert "remove base_link and efector_link (Adjacent): they come as near as -" in said
    assert "add base_link and brazo_link (Adjacent)" in said
    assert srdf.read_text() == wrong
    assert run(["collision", "matrix", str(folder), "--write"]) is ExitCode.OK
    changed = srdf.read_text()
    reasons = {entry.pair: entry.reason for entry in entries(changed)}
    assert reasons[frozenset(("base_link", "brazo_link"))] == "Adjacent"
    assert reasons[frozenset(("base_link", "antebrazo_link"))] == "A person's"
    assert frozenset(("base_link", "efector_link")) not in reasons
    assert changed.count("<!--") == text.count("<!--")


def test_fit_says_spheres_and_bulge_of_every_link(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["collision", "fit", str(folder), "--bulge", "8mm"]) is ExitCode.OK
    heading, *rows, last = capfd.readouterr().out.splitlines()
    assert heading.split() == ["link", "shapes", "spheres", "bulge", "[mm]"]
    assert [row.split()[0] for row in rows] == ["base_link", "brazo_link", "antebrazo_link", "efector_link"]
    assert all(int(row.split()[2]) > 0 and 0.0 <= float(row.split()[3]) <= 8.0 for row in rows)
    assert int(last.split()[1]) == sum(int(row.split()[2]) for row in rows)


def test_fit_to_the_meshes_is_printed_and_written_only_when_asked(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    urdf = folder / "robot.urdf"
    before, shipped = urdf.read_text(), {link.name: len(link.collisions) for link in read_urdf(urdf).links}
    line = ["collision", "fit", str(folder), "--meshes", "--most", "1", "--link", "antebrazo_link"]
    assert run(line) is ExitCode.OK
    heading, row, *elements, last = capfd.readouterr().out.splitlines()
    assert heading.split("  ")[-3:] == ["95 % within [mm]", "worst [mm]", "at [mm]"]
    assert row.split()[:2] == ["antebrazo_link", "1"]
    assert elements[:2] == ["antebrazo_link:", "<collision>"]
    assert "--write" in last
    assert urdf.read_text() == before
    assert run([*line, "--write"]) is ExitCode.OK
    said = capfd.readouterr().out
    assert f"{urdf} is changed" in said
    assert "gemelo collision matrix" in said
    after = urdf.read_text()
    assert "\n".join(f"    {element}" for element in elements[1:]) in after
    counts = {link.name: len(link.collisions) for link in read_urdf(urdf).links}
    assert counts == {**shipped, "antebrazo_link": 1}


def test_fit_says_how_far_it_is_and_what_it_could_not_meet(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    line = ["collision", "fit", str(folder), "--meshes", "--within", "0.5mm", "--most", "2", "--link", "antebrazo_link"]
    assert run(line) is ExitCode.OK
    progress, warning = capfd.readouterr().err.splitlines()
    assert progress.startswith('link "antebrazo_link" (1 of 1), 2036 triangles: 2 shapes after ')
    assert warning.startswith('warning: link "antebrazo_link": ')
    assert "is within 0.5 mm of its mesh, not 95 %" in warning
    assert "give `gemelo collision fit` --most 4 or --within " in warning


def test_fit_says_what_it_cannot_do(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["collision", "fit", str(folder), "--write"]) is ExitCode.USAGE
    assert "--meshes" in capfd.readouterr().err
    assert run(["collision", "fit", str(folder), "--meshes", "--link", "brazo"]) is ExitCode.FAILED
    assert 'no link "brazo"' in capfd.readouterr().err
    (folder / "meshes" / "brazo_link.glb").unlink()
    assert run(["collision", "fit", str(folder), "--meshes"]) is ExitCode.FAILED
    assert "brazo_link.glb is not there" in capfd.readouterr().err


def test_a_folder_that_is_no_robot_is_one_sentence(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["collision", "matrix", str(tmp_path)]) is ExitCode.USAGE
    assert "robot.toml" in capfd.readouterr().err
    assert run(["collision", "fit", str(tmp_path)]) is ExitCode.FAILED
    assert "robot.toml" in capfd.readouterr().err
