"""cell.toml and camera.toml: the samples load, and every fault names the file, the line, the thing and the remedy."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import pytest

from gemelo.libraries.arm.cell.camera_file import load_measured, write_measured
from gemelo.libraries.arm.cell.camera_model import believed_info, exact_info, looking, scaled
from gemelo.libraries.arm.cell.cell_file import Cell, grasp_width, load_cell
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.frames.transforms import from_message, rotate
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.schemas.cell import Calibration, MeasuredCamera, Mount, TagThing, VirtualSource
from tests.arm.editing import edit


@pytest.fixture
def file(rm1_folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(rm1_folder / "cell.toml", tmp_path / "cell.toml"))


@pytest.mark.parametrize("robot", ["rm1", "parol6"])
def test_the_sample_of_every_arm_loads(rm1_folder: Path, robot: str) -> None:
    arm = load_arm(rm1_folder.parent / robot)
    cell = load_cell(rm1_folder.parent / robot / "cell.toml", arm)
    assert isinstance(cell.camera("overhead").source, VirtualSource)
    cup = cell.thing("cup")
    assert isinstance(cup, TagThing)
    assert cup.box is not None
    assert grasp_width(cup) == cup.box[0]
    assert cell.place("bin").name == "bin"


FAULTS = [  # the change, how the line begins that must be named, the sentence
    ("look_at = [0.27", "look_att = [0.27", "look_att", r"unknown key `camera\[0\].look_att`.*\"look_at\"\?"),
    ("distortion = [0", "distorsion = [0", "distorsion", r"unknown key `camera\[0\].source.distorsion`.*\"distor"),
    ("id = 50\nsize", "id = 50\nsise", "sise", r"unknown key `place\[1\].sise`; did you mean \"size\"\?"),
    ("[[place]]", "[[plaice]]", "[[plaice]]", r"unknown key `plaice`.*\"place\""),
    ("fps = 5.0", 'fps = "fast"', "fps", r".*float.*camera\[0\].fps"),
    ("fps = 5.0", "fps = 0.0", "fps", r".*> 0.0.*fps"),
    ("noise = 3.0", "noise = nan", "noise", r"`camera\[0\].source.noise` is nan: it must be finite"),
    ('kind = "virtual"', 'kind = "virtuel"', "kind", r".*virtuel.*known are v4l2, folder, file, virtual"),
    ('kind = "pose"', 'kind = "post"', 'kind = "post"', r".*'post'.*known are pose, tag"),
    ('kind = "pose"\n', "", "[[place]]", r".*missing required field `kind`.*known are pose, tag"),
    ('colour = "red"', 'colour = "pink"', "colour", r".*'pink'.*colour"),
    ('name = "overhead"', 'name = "Over head"', "name", r".*camera\[0\].name"),
    ('name = "red_block"', 'name = "cup"', 'name = "cup"\nkind = "colour"', r'there are two \[\[thing\]\] "cup"'),
    ("fps = 5.0", 'parent = "efektor_link"', "parent", r'.*rm1 has no link "efektor_link".*"efector_link"'),
    ("look_at = [0.27, 0.0, 0.0]", "look_at = [0.54, 0.0, 0.48]", "look_at", r'camera "overhead" looks at the point'),
    ("0.0008, -0.0005, 0.02]", "0.0008]", "distortion", r".*distortion has 3 numbers: write k1, k2, p1, p2, k3"),
    ("id = 101", "id = 100", "id = 100\nsize = 0.04\nposition = [0.42, -", r".*\[\[tag\]\] 1: print another"),
    ("id = 101", "id = 587", "id = 587", r".*apriltag_36h11 has the tags 0 to 586, not 587"),
    ("box = [0.03, 0.03, 0.03]", "box = [0.06, 0.07, 0.03]", "box = [0.06", r'.*"red_block" is 0.06 m.*open to 0.05 m'),
    ("grasp_offset", "grasp_width = 0.09\ngrasp_offset", "grasp_width", r'.*"cup" is 0.09 m between the jaws'),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "at", "sentence"), FAULTS, ids=[new[:30] for _, new, _, _ in FAULTS])
def test_a_fault_names_the_line_the_thing_and_the_remedy(
    file: Path, rm1: ArmDescription, old: str, new: str, at: str, sentence: str
) -> None:
    edit(file, old, new)
    text = file.read_text()
    line = text[: text.index(f"\n{at}") + 1].count("\n") + 1
    with pytest.raises(DescriptionError, match=f"line {line}: {sentence}") as raised:
        load_cell(file, rm1)
    assert str(file) in str(raised.value)


def test_what_is_not_toml_is_said_with_its_line(file: Path, rm1: ArmDescription) -> None:
    edit(file, "[[camera]]", "[[camera")
    with pytest.raises(DescriptionError, match="line 9: this is not TOML"):
        load_cell(file, rm1)


def test_a_name_that_is_not_there_gets_the_nearest_one(file: Path, rm1: ArmDescription) -> None:
    cell = load_cell(file, rm1)
    with pytest.raises(DescriptionError, match=r'no \[\[thing\]\] "red_blok"; did you mean "red_block"\?'):
        cell.thing("red_blok")


def test_a_cell_file_that_is_not_there_is_said(tmp_path: Path, rm1: ArmDescription) -> None:
    with pytest.raises(DescriptionError, match="there is no such file"):
        load_cell(tmp_path / "cell.toml", rm1)


def test_a_camera_looks_where_it_is_told_with_the_parents_z_up(file: Path, rm1: ArmDescription) -> None:
    turn = looking((0.5, 0.0, 0.5), (0.0, 0.0, 0.0), 0.0)
    assert rotate(turn, (0.0, 0.0, 1.0)) == pytest.approx((-math.sqrt(0.5), 0.0, -math.sqrt(0.5)))
    assert rotate(turn, (1.0, 0.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0))
    assert rotate(turn, (0.0, -1.0, 0.0))[2] > 0.7
    down = looking((0.2, 0.1, 0.5), (0.2, 0.1, 0.0), 0.0)
    assert rotate(down, (0.0, -1.0, 0.0)) == pytest.approx((1.0, 0.0, 0.0))
    rolled = looking((0.2, 0.1, 0.5), (0.2, 0.1, 0.0), math.pi / 2)
    assert rotate(rolled, (1.0, 0.0, 0.0)) == pytest.approx(rotate(down, (0.0, 1.0, 0.0)))


def test_a_real_camera_is_assumed_until_it_is_measured_and_a_virtual_one_is_exact(
    file: Path, rm1: ArmDescription
) -> None:
    virtual = load_cell(file, rm1)
    info = believed_info(virtual, virtual.camera("overhead"), rm1.base_frame)
    assert (info.is_calibrated, info.is_mounted, info.parent) == (True, True, "base_link")
    assert info.intrinsics[0] == pytest.approx(320.0 / math.tan(0.575))
    assert info.intrinsics[2] == 319.5
    edit(file, 'kind = "virtual"\n', 'kind = "v4l2"\ndevice = "/dev/video0"\n')
    for line in ("distortion = [0.08, -0.16, 0.0008, -0.0005, 0.02]\n", "blur = 0.6\n", "noise = 3.0\n"):
        edit(file, line, "")
    real = load_cell(file, rm1)
    info = believed_info(real, real.camera("overhead"), rm1.base_frame)
    assert (info.is_calibrated, info.is_mounted) == (False, False)


def test_what_was_measured_comes_back_and_wins_also_over_a_virtual_cameras_truth(
    file: Path, rm1: ArmDescription
) -> None:
    lens = Calibration(
        size=(1280, 960), intrinsics=(1100.0, 0.0, 640.0, 0.0, 1101.0, 470.0, 0.0, 0.0, 1.0),
        distortion=(0.1, -0.2, 0.0, 0.0, 1e-3), held_out=0.11, focal_sigma=0.36, date="2026-11-23",
    )  # fmt: skip
    mount = Mount(parent="efector_link", position=(0.1, 0.0, -0.2), rotation=(1.0, 0.0, 0.0, 0.0), held_out=3e-4)
    measured = MeasuredCamera(name="overhead", calibration=lens, mount=mount)
    write_measured(file.with_name("camera.toml"), [measured])
    assert load_measured(file.with_name("camera.toml"), ["overhead"]) == {"overhead": measured}
    cell = load_cell(file, rm1)
    info = believed_info(cell, cell.camera("overhead"), rm1.base_frame)
    assert info.parent == "efector_link"
    assert from_message(info.parent_from_camera)[0] == (0.1, 0.0, -0.2)
    assert info.intrinsics[0] == 550.0
    assert info.distortion == lens.distortion
    assert exact_info(cell.camera("overhead"), rm1.base_frame).parent == "base_link"


def test_half_the_size_is_the_same_rays() -> None:
    """The middle of the first 2 x 2 pixels, (0.5, 0.5), is the centre (0, 0) of the first pixel of half the size."""
    matrix = (1000.0, 0.0, 639.5, 0.0, 1000.0, 479.5, 0.0, 0.0, 1.0)
    half = scaled(matrix, (1280, 960), (640, 480))
    assert (0.5 - matrix[2]) / matrix[0] == pytest.approx((0.0 - half[2]) / half[0])
    assert half[:3] == (500.0, 0.0, 319.5)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ('[[camera]]\nname = "overheat"\n', 'cell.toml has no camera "overheat"; did you mean "overhead"'),
        (
            '[[camera]]\nname = "overhead"\n[camera.calibration]\nsize = [640, 480]\nintrinsics = [1.0]\n',
            "1 intrinsics",
        ),
        ('[[camera]]\nname = "overhead"\n[camera.mont]\n', r'line 3: unknown key `camera\[0\].mont`.*"mount"'),
        (
            '[[camera]]\nname = "overhead"\n[camera.mount]\nparent = "base_link"\nposition = [0.0, 0.0, 1.0]\n'
            "rotation = [1.0, 1.0, 0.0, 0.0]\n",
            "no unit quaternion; measure it again",
        ),
    ],
)
def test_a_spoilt_camera_file_is_said_with_the_remedy(
    file: Path, rm1: ArmDescription, text: str, sentence: str
) -> None:
    file.with_name("camera.toml").write_text(text)
    with pytest.raises(DescriptionError, match=sentence):
        load_cell(file, rm1)


def test_an_empty_cell_is_one(tmp_path: Path, rm1: ArmDescription) -> None:
    (tmp_path / "cell.toml").write_text("")
    cell = load_cell(tmp_path / "cell.toml", rm1)
    assert cell == Cell(tmp_path / "cell.toml")
