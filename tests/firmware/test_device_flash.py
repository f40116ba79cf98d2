"""`gemelo device flash`, from a release to a board that is ready: esptool itself, the ROM's protocol on a
pseudo-terminal, and behind it the firmware core."""

from __future__ import annotations

import configparser
import hashlib
import json
import shutil
import struct
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml
from rom_board import CHIP_C3, CHIP_S3, RomBoard
from update_bed import UpdateBed

from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.firmware_update import ImageHeader, build_header
from gemelo.schemas.device_config import config_text
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.device import firmware_release, flash_tool
from gemelo.tools.cli.main import run

VERSION = "1.2.0"
SLOT = 0x1E0000


def image(chip: int, content: bytes, project: str = "gemelo") -> bytes:
    """An image as ESP-IDF builds one: header, one segment, checksum, SHA-256."""
    described = build_header(ImageHeader(chip, VERSION, project))
    head = bytearray(described[:24])
    head[1], head[23] = 1, 1  # segments, a digest is appended
    content = described[32:] + content
    body = bytes(head) + struct.pack("<II", 0x3F400020, len(content)) + content
    body += bytes(15 - len(body) % 16) + b"\xef"
    return body + hashlib.sha256(body).digest()


def table(slot: int = SLOT) -> bytes:
    """The partition table of firmware/platform/esp32/partitions.csv."""
    rows = (
        (1, 2, 0x9000, 0x10000, b"nvs"), (1, 1, 0x19000, 0x1000, b"phy_init"), (1, 0, 0x1A000, 0x2000, b"otadata"),
        (0, 0x10, 0x20000, slot, b"ota_0"), (0, 0x11, 0x200000, SLOT, b"ota_1"),
    )  # fmt: skip
    entries = b"".join(struct.pack("<HBBII16sI", 0x50AA, *row, 0) for row in rows)
    return entries.ljust(0xC00, b"\xff")


def build(folder: Path, chip: int = CHIP_C3, project: str = "gemelo") -> Path:
    """A folder as PlatformIO leaves it."""
    folder.mkdir(parents=True)
    (folder / "bootloader.bin").write_bytes(image(chip, b"boot loader" * 100, "bootloader"))
    (folder / "partitions.bin").write_bytes(table())
    (folder / "firmware.bin").write_bytes(image(chip, bytes(range(256)) * 300, project))
    return folder


@pytest.fixture
def board(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[RomBoard]:
    bed = UpdateBed(tmp_path, monkeypatch)
    bed.start()
    made = RomBoard(Path(bed.port))
    yield made
    made.close()
    bed.stop()


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """rm1 with slower sensors: another configuration than the board has, which is armed."""
    folder = tmp_path / "rm1"
    shutil.copytree(project_root() / "urdf/rm1", folder)
    text = (folder / "robot.toml").read_text()
    assert text.count("sensor_hz = 10\n") == 1
    (folder / "robot.toml").write_text(text.replace("sensor_hz = 10\n", "sensor_hz = 5\n"))
    monkeypatch.setenv("GEMELO_ROBOT", str(folder))
    return folder


def flash(board: RomBoard, path: Path, *more: str) -> ExitCode:
    return run(["device", "flash", "--image", str(path), "--port", board.port, "--yes", *more])


def release(folder: Path, *names: str) -> Path:
    """A zip as the workflow attaches it to a release, with the builds of these names."""
    chips = {"esp32c3": (CHIP_C3, "ESP32-C3"), "esp32s3": (CHIP_S3, "ESP32-S3")}
    for name in names:
        build(folder / "builds" / name, chips[name][0])
    assert firmware_release.main([str(folder / "builds"), str(folder / "release")]) == 0
    return folder / "release" / f"gemelo-firmware-{VERSION}.zip"


def test_a_board_becomes_ready(board, robot, tmp_path, capsys):
    folder = build(tmp_path / "esp32c3")
    board.flash[0x1A000:0x1A004] = b"\x01\x00\x00\x00"  # an update over the air had made it start the other slot
    assert flash(board, folder, "--device", "rm1") is ExitCode.OK
    text = capsys.readouterr().out
    assert f"gemelo {VERSION} for ESP32-C3" in text
    for name, place in (("bootloader.bin", 0), ("partitions.bin", 0x8000), ("firmware.bin", 0x20000)):
        content = (folder / name).read_bytes()
        assert board.flash[place : place + len(content)] == content
    assert board.flash[0x1A000:0x1C000] == b"\xff" * 0x2000
    assert "telling it device rm1" in text
    assert "it is ready: rm1, firmware" in text
    kept = json.loads((tmp_path / "virtual_esp32_flash.json").read_text())
    assert config_text(device_config(load_arm(robot))).decode() in kept.values()


def test_of_a_release_the_build_of_the_board_s_chip_is_taken(board, robot, tmp_path, capsys):
    assert flash(board, release(tmp_path, "esp32s3", "esp32c3")) is ExitCode.OK
    content = (tmp_path / "builds/esp32c3/firmware.bin").read_bytes()
    assert board.flash[0x20000 : 0x20000 + len(content)] == content


def test_a_release_without_the_board_s_chip_is_refused(board, robot, tmp_path, capsys):
    assert flash(board, build(tmp_path / "esp32s3", CHIP_S3)) is ExitCode.FAILED
    assert "the board is an ESP32-C3, the image is for ESP32-S3" in capsys.readouterr().err
    assert not board.is_written


def test_a_board_that_does_not_answer_is_said_with_what_to_press(board, robot, tmp_path, capsys):
    board.is_deaf = True
    assert flash(board, build(tmp_path / "esp32c3")) is ExitCode.FAILED
    assert "hold BOOT, press and release EN" in capsys.readouterr().err


def test_a_flash_that_reads_back_otherwise_is_said(board, robot, tmp_path, capsys):
    board.is_worn = True
    assert flash(board, build(tmp_path / "esp32c3")) is ExitCode.FAILED
    assert "what was written reads back otherwise" in capsys.readouterr().err


def damage(name: str, change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    """Changes that file of a build."""
    return lambda folder: (folder / name).write_bytes(change((folder / name).read_bytes())) and None


WRONG: dict[str, tuple[Callable[[Path], None], str]] = {
    "flipped": (damage("firmware.bin", lambda file: file[:900] + b"\x00\x01" + file[902:]), "firmware.bin is damaged"),
    "cut": (damage("firmware.bin", lambda file: file[:5000]), "firmware.bin is damaged"),
    "headless": (damage("firmware.bin", lambda file: file[:20]), "too few for an image"),
    "missing": (lambda folder: (folder / "partitions.bin").unlink(), "has no partitions.bin"),
    "another chip's": (
        damage("bootloader.bin", lambda _: image(CHIP_S3, b"boot", "bootloader")), "is for another chip (number 9)",
    ),
    "another firmware": (damage("firmware.bin", lambda _: image(CHIP_C3, b"x", "blink")), 'the firmware "blink"'),
    "no table": (damage("partitions.bin", lambda _: b"\xff" * 3072), "is no partition table"),
    "no OTA": (damage("partitions.bin", lambda file: file[:64] + b"\xff" * 3008), "has no partition otadata"),
    "narrow": (damage("partitions.bin", lambda _: table(0x1000)), "its slot 4096"),
    "an older chip's": (damage("firmware.bin", lambda _: image(2, b"x")), "is for ESP32-S2"),
}  # fmt: skip


@pytest.mark.parametrize("wrong", WRONG)
def test_a_build_that_would_not_start_is_refused_before_the_port_is_opened(robot, tmp_path, capsys, wrong):
    folder = build(tmp_path / "esp32c3")
    spoil, said = WRONG[wrong]
    spoil(folder)
    words = ["device", "flash", "--image", str(folder), "--port", str(tmp_path / "no port"), "--yes"]
    assert run(words) is ExitCode.USAGE
    assert said in capsys.readouterr().err


def test_what_is_no_release_is_refused(robot, tmp_path, capsys):
    for name, content, said in (
        ("none.zip", None, "there is no"), ("text.zip", b"text", "not a zip file"),
        ("song.mp3", b"la", "give the folder"),
        ("manifest.json", b"{", "its manifest is none of ESP Web Tools"),
    ):  # fmt: skip
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content)
        assert run(["device", "flash", "--image", str(path), "--port", "/dev/null", "--yes"]) is ExitCode.USAGE
        assert said in capsys.readouterr().err
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as opened:
        opened.writestr("readme.txt", "hello")
    assert run(["device", "flash", "--image", str(tmp_path / "other.zip"), "--port", "x", "--yes"]) is ExitCode.USAGE
    assert "has no manifest.json" in capsys.readouterr().err


def test_without_esptool_its_installation_is_named(robot, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(flash_tool.sys, "executable", str(tmp_path / "python"))
    monkeypatch.setenv("PATH", str(tmp_path))
    assert run(["device", "flash", "--image", str(build(tmp_path / "c3")), "--port", "x", "--yes"]) is ExitCode.FAILED
    assert "pipx install esptool" in capsys.readouterr().err


def test_a_port_that_is_not_there_is_named(robot, tmp_path, capsys):
    port = str(tmp_path / "ttyUSB9")
    assert run(["device", "flash", "--image", str(build(tmp_path / "c3")), "--port", port, "--yes"]) is ExitCode.FAILED
    assert f"cannot open {port}: is it plugged in" in capsys.readouterr().err


def test_the_manifest_is_that_of_a_browser_flasher(tmp_path):
    release(tmp_path, "esp32s3", "esp32c3")
    manifest = json.loads((tmp_path / "release/manifest.json").read_text())
    assert (manifest["name"], manifest["version"]) == ("gemelo", VERSION)
    assert [each["chipFamily"] for each in manifest["builds"]] == ["ESP32-C3", "ESP32-S3"]
    for each in manifest["builds"]:
        assert [part["offset"] for part in each["parts"]] == [0, 0x8000, 0x1A000, 0x20000]
        assert all((tmp_path / "release" / part["path"]).is_file() for part in each["parts"])


def test_the_workflow_builds_every_environment_but_those_with_a_console():
    environments = configparser.ConfigParser(inline_comment_prefixes=";")
    environments.read(project_root() / "firmware/platformio.ini")
    names = {each.removeprefix("env:") for each in environments.sections() if each.startswith("env:")}
    workflow = yaml.safe_load((project_root() / ".github/workflows/firmware.yml").read_text())
    commands = [step.get("run", "") for step in workflow["jobs"]["build"]["steps"]]
    built = next(command for command in commands if command.startswith("pio run")).split()
    assert {built[at + 1] for at, word in enumerate(built) if word == "-e"} == {
        name for name in names if not name.endswith(firmware_release.DEBUG)
    }
