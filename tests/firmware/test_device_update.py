"""A new firmware for a virtual board, from the command line to what it boots: two slots, a signature, a trial."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from bench_firmware import command
from update_bed import NEWER, OLDER, LossyWire, UpdateBed, an_image, silent_core

from gemelo.firmware.platform.host.image import source_version, virtual_image
from gemelo.libraries.runtime.firmware_update import (
    HEADER,
    PIECE,
    VIRTUAL_CHIP,
    ImageHeader,
    NoImage,
    UpdateStep,
    build_header,
    leave_for_older,
    read_header,
    update_frame,
)
from gemelo.libraries.runtime.signatures import is_signed, make_key, sign
from gemelo.schemas.device import DeviceCommandKind
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.device import device_update, update_transfer
from gemelo.tools.cli.device.provision import BAUD, open_line
from gemelo.tools.cli.device.update_transfer import SerialWire, Transfer, await_status
from gemelo.tools.cli.main import run

WHOLE: Callable[[int, bytes], list[bytes]] = lambda _, frame: [frame]  # noqa: E731


@pytest.fixture
def bed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[UpdateBed]:
    monkeypatch.setattr(update_transfer, "ANSWER_TIME", 0.5)
    monkeypatch.setattr(device_update, "TO_ANSWER", 20.0)
    made = UpdateBed(tmp_path, monkeypatch)
    made.start()
    yield made
    made.stop()


def transfer(
    bed: UpdateBed, passes: Callable[[int, bytes], list[bytes]] = WHOLE, image: bytes = b""
) -> tuple[int, int]:
    """Sends it over a line that is not good; bytes that the device had from before, and frames that were sent."""
    image = image or an_image()
    with open_line(bed.port, BAUD) as line:
        wire = LossyWire(SerialWire(line), passes)
        status = await_status(wire, 20.0, lambda _: True)
        assert status is not None
        had = Transfer(wire, image, sign(bed.key, image), lambda _: None).run(status.boot_id)
    return had, wire.sent


def reason(bed: UpdateBed, capsys: pytest.CaptureFixture[str], image: bytes) -> str:
    """Why the update was refused; the firmware that runs is the old one then."""
    assert bed.update(image) is ExitCode.FAILED
    assert bed.record["slot"] == 0 if (bed.folder / "virtual_esp32_ota.json").exists() else True
    return capsys.readouterr().err


@pytest.mark.full
def test_a_board_runs_the_new_firmware_from_the_other_slot_and_keeps_it(
    bed: UpdateBed, capsys: pytest.CaptureFixture[str]
) -> None:
    assert bed.update(an_image()) is ExitCode.OK
    said = capsys.readouterr().out
    assert f"gemelo {NEWER} for virtual device" in said
    assert f"it runs firmware {NEWER} from ota_1; before it was {source_version()} in ota_0" in said
    bed.stop()
    assert bed.record == {"slot": 1, "state": "valid"}
    assert (bed.folder / "virtual_esp32_ota_1.bin").read_bytes() == an_image()
    bed.start()
    assert bed.update(an_image()) is ExitCode.OK  # into the first slot, this time
    assert f"from ota_0; before it was {NEWER} in ota_1" in capsys.readouterr().out


def test_an_older_firmware_is_refused_though_it_is_signed(bed: UpdateBed, capsys: pytest.CaptureFixture[str]) -> None:
    """Whoever has kept an image that was signed once could bring its faults back."""
    said = reason(bed, capsys, an_image(version=OLDER))
    assert f"its version {OLDER} is older than what runs, {source_version()}" in said
    assert "`gemelo device update --downgrade` sends it" in said


@pytest.mark.full
def test_an_older_firmware_is_taken_where_the_keys_owner_says_so(
    bed: UpdateBed, capsys: pytest.CaptureFixture[str]
) -> None:
    assert bed.update(an_image(version=OLDER), "--downgrade") is ExitCode.OK
    assert f"it runs firmware {OLDER} from ota_1; before it was {source_version()}" in capsys.readouterr().out
    bed.stop()
    bed.start()
    assert bed.update(an_image()) is ExitCode.OK, "and what is newer than that again without a word"


def test_the_leave_to_go_back_is_for_one_boot(bed: UpdateBed) -> None:
    image = an_image(version=OLDER)
    with open_line(bed.port, BAUD) as line:
        wire = SerialWire(line)
        status = await_status(wire, 20.0, lambda _: True)
        assert status is not None
        leave = sign(bed.key, leave_for_older(hashlib.sha256(image).digest(), status.boot_id + 1))
        with pytest.raises(CommandError, match="its signature is not by the key"):
            Transfer(wire, image, leave, lambda _: None).run(status.boot_id)


@pytest.mark.full
def test_a_firmware_that_says_nothing_gives_way_to_the_one_before(
    bed: UpdateBed, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from gemelo.firmware.platform.host import virtual_esp32

    monkeypatch.setattr(virtual_esp32, "TRIAL", 1.0)
    assert bed.update(an_image(silent_core(tmp_path))) is ExitCode.FAILED
    assert f"has gone back to firmware {source_version()} in ota_0" in capsys.readouterr().err
    assert bed.record == {"slot": 0, "state": "valid"}


@pytest.mark.full
def test_a_firmware_that_does_not_start_gives_way_at_once(bed: UpdateBed, capsys: pytest.CaptureFixture[str]) -> None:
    assert bed.update(an_image(b"\x7fELF" + 5000 * b"no library at all")) is ExitCode.FAILED
    assert "has gone back to firmware" in capsys.readouterr().err


@pytest.mark.full
def test_a_board_that_is_cut_off_in_the_trial_starts_the_firmware_before(bed: UpdateBed) -> None:
    transfer(bed)
    bed.stop()  # before anybody has heard its status
    if bed.record["state"] == "new":  # it had not yet restarted
        bed.start(is_spoken_to=False)
        bed.stop()
    assert bed.record == {"slot": 1, "state": "pending_verify"}
    bed.start(is_spoken_to=False)
    bed.stop()
    assert bed.record == {"slot": 0, "state": "valid"}


def test_what_is_lost_doubled_or_damaged_on_its_way_is_sent_again_and_written_once(bed: UpdateBed) -> None:
    def passes(number: int, frame: bytes) -> list[bytes]:
        faults: dict[int, list[bytes]] = {4: [], 7: [frame, frame], 9: [frame[:-1] + bytes([frame[-1] ^ 1])]}
        return faults.get(number, [frame])

    had, sent = transfer(bed, passes)
    pieces = -(-len(an_image()) // PIECE)
    assert had == 0
    assert sent == pieces + 2 + 2
    bed.stop()
    assert (bed.folder / "virtual_esp32_ota_1.bin").read_bytes() == an_image()


@pytest.mark.full
def test_a_transfer_that_was_cut_off_goes_on_where_it_ended(bed: UpdateBed, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(update_transfer, "TRIES", 2)
    with pytest.raises(CommandError, match=rf"cut off at {9 * PIECE} of \d+ bytes; what the device runs is as before"):
        transfer(bed, lambda number, frame: [frame] if number <= 10 else [])
    had, sent = transfer(bed)
    assert had == 9 * PIECE
    assert sent == -(-len(an_image()) // PIECE) - 9 + 2


@pytest.mark.full
def test_a_session_that_another_one_has_taken_over_is_over(bed: UpdateBed) -> None:
    image = an_image()

    def passes(number: int, frame: bytes) -> list[bytes]:
        if number != 5:
            return [frame]
        # Somebody else begins with the same image.
        boot_id = int.from_bytes(frame[4:8], "little")
        content = len(image).to_bytes(4, "little") + hashlib.sha256(image).digest() + sign(bed.key, image)
        return [update_frame(UpdateStep.BEGIN, 4711, boot_id, 0, content), frame]

    with pytest.raises(CommandError, match="another transfer has begun since"):
        transfer(bed, passes)


@pytest.mark.full
def test_an_armed_device_is_not_updated_and_one_that_is_armed_meanwhile_waits(
    bed: UpdateBed, capsys: pytest.CaptureFixture[str]
) -> None:
    def passes(number: int, frame: bytes) -> list[bytes]:
        if number == 5:
            bed.tell(command(DeviceCommandKind.ARM, cmd_id=2, boot=int.from_bytes(frame[4:8], "little")))
        return [frame]

    with pytest.raises(CommandError, match="the device is armed: disarm it first"):
        transfer(bed, passes)
    assert "the device is armed: `gemelo device disarm` first" in reason(bed, capsys, an_image())
    bed.tell(command(DeviceCommandKind.DISARM, cmd_id=3, boot=0))
    had, _ = transfer(bed)
    assert had >= 3 * PIECE


@pytest.mark.full
def test_a_wrong_signature_and_a_board_without_a_key_are_refused(
    bed: UpdateBed, capsys: pytest.CaptureFixture[str]
) -> None:
    right = bed.key
    bed.key = bed.folder / "other.key"
    make_key(bed.key, bed.key.with_suffix(".pub"))
    assert "its signature is not by the key that this device was provisioned with" in reason(bed, capsys, an_image())
    bed.stop()
    bed.key = right
    bed.start(with_key=False)
    assert "it has no key for updates: provision --update-key" in reason(bed, capsys, an_image())
    assert not list(bed.folder.glob("*.part"))


@pytest.mark.full
def test_an_image_for_another_chip_one_that_is_too_large_and_one_that_is_damaged_are_refused(
    bed: UpdateBed, capsys: pytest.CaptureFixture[str]
) -> None:
    esp32 = build_header(ImageHeader(0, "1.0.0", "gemelo")) + bytes(5000)
    assert "this image is for another chip: for number 0, this one is 65534" in reason(bed, capsys, esp32)
    large = build_header(ImageHeader(VIRTUAL_CHIP, "1.0.0", "gemelo")) + bytes(0x1E0000)
    assert f"it has {len(large)} bytes, the slot 1966080" in reason(bed, capsys, large)
    hollow = build_header(ImageHeader(VIRTUAL_CHIP, "1.0.0", "gemelo")) + bytes(5000)
    assert "it is damaged: there is no library behind its header" in reason(bed, capsys, hollow)
    image = an_image()

    def passes(number: int, frame: bytes) -> list[bytes]:
        if number != 3:
            return [frame]
        header = (int.from_bytes(frame[at : at + 4], "little") for at in (8, 4, 12))
        session, boot_id, offset = header
        return [update_frame(UpdateStep.DATA, session, boot_id, offset, bytes(len(frame) - 24))]  # CRC and all

    with pytest.raises(CommandError, match="its checksum is not that of what was signed"):
        transfer(bed, passes, image)


def test_what_the_command_line_can_see_is_refused_before_a_board_is_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    key, file = tmp_path / "k.key", tmp_path / "firmware.bin"

    def said(*words: str) -> str:
        assert run(["device", "update", *words, "--serial", str(tmp_path / "tty")]) is not ExitCode.OK
        return capsys.readouterr().err

    assert "which file?" in said()
    assert "cannot read" in said(str(file))
    file.write_bytes(b"too short")
    assert "9 bytes are too few for an image" in said(str(file))
    file.write_bytes(bytes(1000))
    assert "its first byte is 0x00, not 0xe9" in said(str(file))
    file.write_bytes(b"\xe9" + bytes(1000))
    assert "is it firmware.bin, not bootloader.bin?" in said(str(file))
    file.write_bytes(virtual_image(b"\x7fELF", "1.0.0"))
    assert "`gemelo device update --make-key` makes a key" in said(str(file), "--key", str(key))
    assert run(["device", "update", "--make-key", "--key", str(key)]) is ExitCode.OK
    assert f"--update-key {key.with_suffix('.pub')}" in capsys.readouterr().out
    assert key.stat().st_mode & 0o777 == 0o600
    assert "is there already" in said("--make-key", "--key", str(key))
    key.chmod(0o644)
    assert "mode 644" in said(str(file), "--key", str(key))
    key.chmod(0o600)
    assert "cannot open" in said(str(file), "--key", str(key))


def test_a_signature_is_of_one_key_and_of_one_image(tmp_path: Path) -> None:
    keys = [tmp_path / name for name in ("a.key", "b.key")]
    for key in keys:
        make_key(key, key.with_suffix(".pub"))
    public = [key.with_suffix(".pub").read_text() for key in keys]
    signature, digest = sign(keys[0], b"image"), hashlib.sha256(b"image").digest()
    assert len(public[0]) <= 256  # that a board keeps
    assert len(signature) <= 72
    assert is_signed(public[0], digest, signature)
    assert not is_signed(public[1], digest, signature)
    assert not is_signed(public[0], hashlib.sha256(b"other").digest(), signature)
    assert not is_signed(public[0], digest, signature[:-1] + bytes([signature[-1] ^ 1]))


def test_an_image_says_of_itself_what_it_was_built_of() -> None:
    header = ImageHeader(9, "2.1.0", "gemelo")
    assert read_header(build_header(header) + b"code") == header
    assert header.chip == "ESP32-S3"
    assert len(build_header(header)) == HEADER == 288
    with pytest.raises(NoImage):
        read_header(b"")
