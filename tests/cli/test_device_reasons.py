"""Refusals of commands about the device: the code and the values of each cause, which has a sentence in Spanish."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from gemelo.libraries.runtime.firmware_update import HEADER, ImageHeader, NoImage, build_header, read_header
from gemelo.schemas.device import DeviceConfiguration, DeviceMode, DeviceState, DeviceStatus
from gemelo.schemas.plain_text import ENGLISH
from gemelo.schemas.reasons import Reason, Value, because, say
from gemelo.tools.cli.common import language
from gemelo.tools.cli.common.errors import CommandError
from gemelo.tools.cli.device import device_monitor, device_update, provision
from gemelo.tools.cli.device.device_press import number, request_of, seconds
from gemelo.tools.cli.device.device_snapshot import configuration_in_force, device_snapshot
from gemelo.tools.cli.device.device_status import text_of, who_it_is
from gemelo.tools.cli.device.update_transfer import Transfer, UpdateStatus
from gemelo.tools.cli.hosts.credentials import CredentialsChange, certificate, password, private_key, require_sound
from gemelo.tools.virtual_arm.virtual_arm import rm1

IMAGE = build_header(ImageHeader(0, "1.2.0", "gemelo"))
BEFORE = UpdateStatus(online=True, firmware="1.1.0", boot_id=1, slot="ota_0")


class SilentWire:
    """A wire on which no answer comes."""

    def send(self, frame: bytes) -> None:
        """Nothing receives it."""

    def knock(self) -> None:
        """Nothing receives it."""

    def take(self, patience: float) -> None:
        """No answer, and none is waited for."""


def sound(**given: str) -> Callable[[], object]:
    return lambda: require_sound(CredentialsChange(**given))  # type: ignore[arg-type]


CAUSES: dict[str, tuple[Callable[[], object], dict[str, Value]]] = {
    "press.form": (lambda: request_of(rm1(), "slip", ["q1"]), {"words": "slip JOINT STEPS"}),
    "press.not_a_number": (lambda: number("many", "steps"), {"text": "many", "what": "steps"}),
    "press.not_finite": (lambda: number("nan", "ultra"), {"text": "nan", "what": "ultra"}),
    "press.negative": (lambda: seconds("-3s"), {"text": "-3s"}),
    "press.held": (lambda: request_of(rm1(), "switch", ["limit_q1", "down"]), {"text": "down"}),
    "update.nobody": (lambda: device_update.update(SilentWire(), IMAGE, b""), {"time": device_update.TO_ANSWER}),
    "update.silent_since": (lambda: device_update.outcome(BEFORE, None), {"time": 45.0, "firmware": "1.1.0"}),
    "update.gone_back": (
        lambda: device_update.outcome(BEFORE, BEFORE),
        {"time": device_update.TRIAL, "firmware": "1.1.0", "slot": "ota_0"},
    ),
    "update.file.unreadable": (
        lambda: device_update.read_image(Path("no.bin")),
        {"file": "no.bin", "error": "No such file or directory"},
    ),
    "update.key.ending": (lambda: device_update.make(Path("my.pub")), {"key": "my.pub"}),
    "provision.port.unopened": (
        lambda: provision.open_line("no_port", 9600).__enter__(),
        {"port": "no_port", "error": "[Errno 2] could not open port no_port: "
                                     "[Errno 2] No such file or directory: 'no_port'"},
    ),
    "provision.bad_answer": (
        lambda: provision.decoded(b"?", provision.ConfigAnswer),
        {"kind": "ConfigAnswer", "error": "JSON is malformed: invalid character (byte 0)"},
    ),
    "provision.ssid.long": (sound(wifi_ssid="ñ" * 17), {"size": 34, "most": 32}),
    "provision.password.length": (sound(wifi_password="short"), {"size": 5, "least": 8, "most": 63}),
    "provision.uri": (sound(mqtt_uri="10.0.0.2"), {"uri": "10.0.0.2"}),
    "provision.baud": (sound(serial_baud="300"), {"baud": "300", "least": 9600, "most": 3_000_000}),
    "provision.certificate_alone": (sound(mqtt_key="k"), {}),
    "provision.nothing": (sound(), {}),
    "provision.pem.unreadable": (
        lambda: certificate(Path("no.pem")),
        {"option": "--mqtt-ca", "path": "no.pem", "error": "[Errno 2] No such file or directory: 'no.pem'"},
    ),
}  # fmt: skip


@pytest.mark.parametrize("code", CAUSES)
def test_a_refusal_has_its_code_and_values(code: str) -> None:
    cause, values = CAUSES[code]
    with pytest.raises(CommandError) as refused:
        cause()
    reason = refused.value.reason
    assert reason is not None
    assert (reason.code, reason.values) == (code, values)
    assert say(reason, "es") != str(reason)


@pytest.mark.parametrize(
    ("image", "why"),
    [
        (b"\xe9", because("firmware.image.short", size=1, least=HEADER)),
        (b"\x7f" + IMAGE[1:], because("firmware.image.magic", byte="0x7f", magic="0xe9")),
        (IMAGE[:32] + bytes(HEADER), because("firmware.image.no_application")),
    ],
)
def test_bytes_that_are_no_image_say_why(image: bytes, why: Reason) -> None:
    with pytest.raises(NoImage) as refused:
        read_header(image)
    assert refused.value.reason == why


def test_a_transfer_without_an_answer_says_where_it_was_cut_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gemelo.tools.cli.device.update_transfer.CHECK_TIME", 0.0)
    with pytest.raises(CommandError) as refused:
        Transfer(SilentWire(), IMAGE, b"", print).run(1)
    cut = because("update.cut_off", at=0, size=len(IMAGE))
    assert refused.value.reason == because("update.no_answer", cut, time=0.0)


def test_files_of_credentials_say_what_is_wrong(tmp_path: Path) -> None:
    file = tmp_path / "rm1.pem"
    file.write_text("words")
    with pytest.raises(CommandError) as none:
        certificate(file)
    assert none.value.reason == because("provision.pem.none", option="--mqtt-ca", path=str(file), what="certificate")
    file.write_text("-----BEGIN CERTIFICATE-----" + "x" * 2048)
    with pytest.raises(CommandError) as long:
        certificate(file)
    assert long.value.reason == because("provision.pem.long", option="--mqtt-ca", path=str(file), size=2075, most=2048)
    file.write_text("-----BEGIN ENCRYPTED PRIVATE KEY-----")
    file.chmod(0o600)
    with pytest.raises(CommandError) as encrypted:
        private_key(file)
    assert encrypted.value.reason == because("provision.pem.encrypted", option="--mqtt-key", path=str(file))


def test_a_password_that_nobody_gives_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    nothing = SimpleNamespace(isatty=lambda: False, readline=lambda: "")
    monkeypatch.setattr("sys.stdin", nothing)
    with pytest.raises(CommandError) as refused:
        password("wifi", "GEMELO_WIFI_PASSWORD", {})
    assert refused.value.reason == because("provision.password.none", what="wifi", variable="GEMELO_WIFI_PASSWORD")
    assert "la contraseña de la Wi-Fi" in say(refused.value.reason, "es")


def test_the_configuration_in_force_is_that_of_the_device_or_why_not() -> None:
    has, wants = DeviceStatus(config_crc32=0xAB, wanted_crc32=0xCD), DeviceStatus(wanted_crc32=0xCD)
    refused = because("device.configuration.changed")
    told = DeviceConfiguration(crc32=0xCD, reason=str(refused), why=refused)
    accepted = DeviceConfiguration(crc32=0xCD, accepted=True)
    assert configuration_in_force(has, accepted) == because("status.configuration.in_force", crc32="000000cd")
    assert configuration_in_force(has, told) == because("cli.device.config.not_in_force", refused)
    other = because("status.configuration.other", crc32="000000ab", wanted="000000cd")
    assert configuration_in_force(has, None) == other
    assert configuration_in_force(wants, None) == because("status.configuration.none", wanted="000000cd")


def test_who_the_device_is_and_why_it_cannot_be_used() -> None:
    why = because("device.offline", device="rm1")
    off = DeviceStatus(device="rm1", reason=str(why), why=why)
    assert who_it_is(off, 0) == because("status.offline", why, device="rm1")
    assert who_it_is(DeviceStatus(device="rm1", speaks=True, why=why), 0).code == "status.not_usable"
    on = who_it_is(DeviceStatus(device="rm1", online=True, virtual=True, firmware="1.2.0", tick_hz=40_000), 0)
    assert (on.code, on.values["tick"]) == ("status.online.virtual", 40.0)


@pytest.fixture
def english_afterwards() -> Iterator[None]:
    yield
    language.choose(ENGLISH)


@pytest.mark.usefixtures("english_afterwards")
def test_the_status_is_one_screen_in_the_language_of_the_command_line() -> None:
    why = because("device.offline", device="rm1")
    status = DeviceStatus(device="rm1", online=True, firmware="1.2.0", reason=str(why), why=why)
    state = DeviceState(mode=DeviceMode.HOLD, name=rm1().joint_names, referenced=(True, False, True))
    view = device_snapshot(rm1(), status, state, None, None)
    english = text_of(view)
    language.choose("es")
    spanish = text_of(view)
    assert len(english.splitlines()) == len(spanish.splitlines())
    assert "drivers  disarmed: the motors are without current" in english
    assert "motores  apagados: los motores están sin corriente" in spanish


def test_every_change_of_the_device_is_a_reason() -> None:
    arm = rm1()
    state = DeviceState(mode=DeviceMode.FAULT, fault=3, fault_joint="q1", name=arm.joint_names, armed=True)
    later = DeviceState(mode=DeviceMode.IDLE, name=arm.joint_names, armed=True, inputs=("limit_q1",), underruns=2)
    assert [each.code for each in device_monitor.state_changes(arm, None, state)] == [
        "monitor.mode", "monitor.fault", "monitor.armed",
    ]  # fmt: skip
    assert device_monitor.state_changes(arm, state, later) == [
        because("monitor.mode", mode="IDLE"),
        because("monitor.input.pressed", name="limit_q1"),
        because("monitor.underruns", count=2),
    ]
    off = DeviceStatus(device="rm1", why=because("device.offline", device="rm1"))
    (gone,) = device_monitor.status_changes(None, off, 0)
    assert gone == because("monitor.offline", because("device.offline", device="rm1"), device="rm1")
