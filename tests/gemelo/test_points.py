"""Taught points: kept under any name, changed one by one, and never lost or outside of their folder."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo import BadArgument
from gemelo.libraries.arm.model.description import load_arm
from gemelo.programs import Points, ProgramError
from gemelo.schemas.reasons import because, remedy

ROBOT = load_arm(Path(__file__).parents[2] / "urdf" / "rm1")
HERE = {"brazo_joint": 0.1, "antebrazo_joint": -0.2, "efector_joint": 0.05}
PNG, JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"
names = st.text(st.characters(exclude_categories=["C"]), min_size=1, max_size=64).filter(lambda n: n == n.strip() != "")
values = st.tuples(*[st.floats(joint.lower, joint.upper) for joint in ROBOT.joints])


@given(st.dictionaries(names, values, max_size=4))
def test_points_are_kept_to_the_last_bit(given: dict[str, tuple[float, ...]]) -> None:
    with TemporaryDirectory() as folder:
        points = Points.load(folder, ROBOT)
        for name, joints in given.items():
            points.remember(name, joints)
        again = Points.load(folder, ROBOT)
        assert {name: tuple(point.joints.values()) for name, point in again.items()} == given
        assert list(again) == list(given)


def test_a_point_is_overwritten_only_when_told(tmp_path: Path) -> None:
    points = Points.load(tmp_path, ROBOT)
    points.remember("a", HERE)
    with pytest.raises(BadArgument, match='there is a point "a": overwrite it'):
        points.remember("a", {**HERE, "brazo_joint": 0.3})
    assert Points.load(tmp_path, ROBOT)["a"].joints == HERE
    points.remember("a", {**HERE, "brazo_joint": 0.3}, overwrite=True)
    assert Points.load(tmp_path, ROBOT)["a"].joints["brazo_joint"] == 0.3


def test_a_renamed_point_keeps_its_place_and_picture_and_a_removed_one_loses_it(tmp_path: Path) -> None:
    points = Points.load(tmp_path, ROBOT)
    for name in "abc":
        points.remember(name, HERE, PNG + name.encode())
    points.rename("b", 'x/../"y"')
    assert list(Points.load(tmp_path, ROBOT)) == ["a", 'x/../"y"', "c"]
    picture = Points.load(tmp_path, ROBOT)['x/../"y"'].picture
    assert picture is not None
    assert picture.read_bytes() == PNG + b"b"
    points.remove('x/../"y"')
    assert not picture.exists()
    with pytest.raises(BadArgument, match='there is a point "c"'):
        points.rename("a", "c")
    with pytest.raises(BadArgument, match='no point "ab" of rm1; did you mean "a"'):
        points.remove("ab")


def test_a_new_picture_takes_the_place_of_the_old_one_and_one_that_is_shared_stays(tmp_path: Path) -> None:
    points = Points.load(tmp_path, ROBOT)
    points.remember("a", HERE, PNG)
    points.remember("b", HERE, PNG)
    shared = points["a"].picture
    points.remember("a", HERE, JPEG, overwrite=True)
    assert shared is not None
    assert shared.exists()
    assert points["b"].picture == shared
    points.remove("b")
    assert not shared.exists()
    assert [path.suffix for path in tmp_path.glob("rm1.points/*")] == [".jpg"]


@pytest.mark.parametrize("name", ["../../etc/x", "a/b", "..", "%2e%2e", "con", "x" * 64, "🦾 ñ 'q' \"d\""])
def test_pictures_stay_in_their_folder_whatever_the_name(name: str, tmp_path: Path) -> None:
    points = Points.load(tmp_path / "programs", ROBOT)
    points.remember(name, HERE, PNG + name.encode())
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert {path.parent for path in files} == {tmp_path / "programs", tmp_path / "programs" / "rm1.points"}
    assert Points.load(tmp_path / "programs", ROBOT)[name].picture in files


@pytest.mark.parametrize("name", ["", "  ", " a", "a\n", "a\0", "\x7f", "x" * 65])
def test_what_can_be_no_name_is_refused(name: str, tmp_path: Path) -> None:
    points = Points.load(tmp_path, ROBOT)
    with pytest.raises(BadArgument):
        points.remember(name, HERE)
    assert not points.file.exists()


@pytest.mark.parametrize(
    ("joints", "said"),
    [
        ({"brazo_joint": 0.1}, "has no value for joint antebrazo_joint, efector_joint: a point has all joints"),
        ({**HERE, "codo": 0.1}, 'rm1 has no joint "codo"'),
        ({**HERE, "brazo_joint": float("nan")}, 'joint "brazo_joint" is nan: it must be finite'),
        ({**HERE, "brazo_joint": 30.0}, "= 30.0000 rad is beyond its limits, -2.9500 rad to 2.9500 rad"),
    ],
)
def test_a_point_where_the_arm_cannot_be_is_refused(joints: dict[str, float], said: str, tmp_path: Path) -> None:
    with pytest.raises(BadArgument, match=said):
        Points.load(tmp_path, ROBOT).remember("a", joints)


@pytest.mark.parametrize(
    ("picture", "said"), [(b"GIF89a", "neither PNG nor JPEG"), (PNG + bytes(10_000_001), "more than")]
)
def test_what_is_no_picture_is_refused(picture: bytes, said: str, tmp_path: Path) -> None:
    points = Points.load(tmp_path, ROBOT)
    with pytest.raises(BadArgument, match=said):
        points.remember("a", HERE, picture)
    assert len(points) == 0
    assert list(tmp_path.iterdir()) == []


def test_what_another_one_has_written_meanwhile_stays(tmp_path: Path) -> None:
    one, other = Points.load(tmp_path, ROBOT), Points.load(tmp_path, ROBOT)
    one.remember("a", HERE)
    other.remember("b", HERE)
    one.remove("a")
    assert list(Points.load(tmp_path, ROBOT)) == ["b"]


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    points = Points.load(tmp_path, ROBOT)
    points.remember("a", HERE)
    before = points.file.read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(Exception, match=r"rm1\.points\.toml cannot be written: No space left on device"):
        points.remember("b", HERE)
    assert points.file.read_bytes() == before
    assert list(points) == ["a"]
    assert list(tmp_path.iterdir()) == [points.file]


WRONG = """version = 3
robot = "rm2"
pints = 1
[points.a]
joints = {brazo_joint = 0.1, antebrazo_joint = 0.2}
[points.b]
joints = {brazo_joint = nan, antebrazo_joint = 0.2, efector_joint = 0.05}
[points.c]
joint = {}
[points.d]
joints = {brazo_joint = 0.1, antebrazo_joint = 0.2, efector_joint = 0.05}
picture = "../../etc/passwd"
[points."e\\u0001"]
joints = {brazo_joint = 0.1, antebrazo_joint = 0.2, efector_joint = 0.05}
"""


def test_all_mistakes_of_a_file_of_points_are_told_at_once_with_their_lines(tmp_path: Path) -> None:
    (tmp_path / "rm1.points.toml").write_text(WRONG)
    with pytest.raises(ProgramError) as told:
        Points.load(tmp_path, ROBOT)
    assert [(mistake.line, mistake.what) for mistake in told.value.mistakes] == [
        (1, because("file.version.other", value="3", known=1)),
        (2, because("point.robot.other", robot="rm2", present="rm1")),
        (3, because("file.key.unknown", remedy("did_you_mean", name="points"), key="pints")),
        (5, because("point.joint.missing", point="a", joints=("efector_joint",))),
        (7, because("point.joint.number", point="b", joint="brazo_joint", value="nan")),
        (8, because("point.joint.none", point="c", example="{brazo_joint = 0.5}")),
        (12, because("point.picture.place", point="d", value="'../../etc/passwd'")),
        (14, because("program.name.control", kind="point", name="e\x01", character="\x01")),
    ]
    assert told.value.reason.code == "file.mistakes"
    assert str(told.value).splitlines() == [str(mistake) for mistake in told.value.mistakes]
