"""Provisioning of a board over a serial line: a pseudo-terminal, and a board of a few lines at its other end."""

from __future__ import annotations

import getpass
import io
import json
import os
import threading
import tty

import msgspec
import pytest

from gemelo.libraries.credentials.authority import Authority
from gemelo.libraries.runtime.serial_frames import JsonFrame, PacketDecoder, json_frame, packet, parse_json_frame
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.device import provision as module
from gemelo.tools.cli.hosts.credentials import CredentialsChange, certificate, password, private_key, require_sound
from gemelo.tools.cli.main import run


class Board:
    """Answers PROVISION as it is told to, and anything else with its status."""

    def __init__(self, master):
        self.told = []
        self.deaf = 0  # packets that are lost
        self.refuses = ""
        self.says = b"rst:0x1 (POWERON)\r\n"  # before everything, as a boot loader does
        self._master, self._packets = master, PacketDecoder()
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def _run(self):
        while True:
            try:
                frames = self._packets.feed(os.read(self._master, 4096))
            except OSError:
                return  # nobody holds the other end any more
            for frame in frames:
                self._on_frame(parse_json_frame(frame))

    def _on_frame(self, found):
        if self.deaf:
            self.deaf -= 1
        elif found is not None and found.kind is JsonFrame.PROVISION:
            self.told.append(json.loads(found.text))
            answer = {"accepted": not self.refuses, "reason": self.refuses}
            self._answer(JsonFrame.PROVISION_ACK, answer)
        else:
            self._answer(JsonFrame.STATUS, {"online": True, "device": "rm1", "firmware": "1.0.0"})

    def _answer(self, kind, content):
        os.write(self._master, self.says + packet(json_frame(kind, msgspec.json.encode(content))))


@pytest.fixture
def line():
    master, slave = os.openpty()
    tty.setraw(slave)
    board = Board(master)
    yield board, os.ttyname(slave)
    os.close(slave)
    board.thread.join(60.0)
    os.close(master)


@pytest.fixture
def quick(monkeypatch):
    for name, value in (("PATIENCE", 0.5), ("AGAIN", 0.1), ("TO_RESTART", 0.5)):
        monkeypatch.setattr(module, name, value)
    monkeypatch.setattr(module.BoardExchange.send, "__defaults__", (0.5,))
    monkeypatch.setattr(module.BoardExchange.status, "__defaults__", (0.5,))


def test_a_board_is_told_what_is_given_and_nothing_else(line, monkeypatch, capsys):
    board, port = line
    monkeypatch.setenv("GEMELO_WIFI_PASSWORD", "correct horse")
    words = ["device", "provision", "--serial", port, "--wifi-ssid", "lab", "--mqtt-uri", "mqtts://10.0.0.2:8883"]
    assert run(words) is ExitCode.OK
    assert board.told == [{"wifi_ssid": "lab", "wifi_password": "correct horse", "mqtt_uri": "mqtts://10.0.0.2:8883"}]
    text = capsys.readouterr().out
    assert "taken: wifi_ssid lab, mqtt_uri mqtts://10.0.0.2:8883, wifi_password given" in text
    assert "it is back: rm1, firmware 1.0.0" in text
    assert "correct horse" not in text


def test_a_board_is_told_the_baud_rate_of_its_line(line, capsys):
    board, port = line
    assert run(["device", "provision", "--serial", port, "--serial-baud", "115200"]) is ExitCode.OK
    assert board.told == [{"serial_baud": "115200"}]
    assert "taken: serial_baud 115200" in capsys.readouterr().out


def test_a_board_is_told_its_own_certificate_with_its_key(line, capsys, tmp_path):
    board, port = line
    Authority(tmp_path / "ca.pem", tmp_path / "ca.key").sign_client("rm1", tmp_path / "rm1.pem", tmp_path / "rm1.key")
    given = ["--mqtt-cert", str(tmp_path / "rm1.pem"), "--mqtt-key", str(tmp_path / "rm1.key")]
    assert run(["device", "provision", "--serial", port, *given]) is ExitCode.OK
    files = {"mqtt_certificate": "rm1.pem", "mqtt_key": "rm1.key"}
    assert board.told == [{key: (tmp_path / file).read_text() for key, file in files.items()}]
    assert "taken: mqtt_certificate given, mqtt_key given" in capsys.readouterr().out


def test_a_key_that_others_can_read_or_that_is_none_is_not_sent(tmp_path):
    pem = tmp_path / "key.pem"
    pem.write_text("-----BEGIN PRIVATE KEY-----\nMIIB\n-----END PRIVATE KEY-----\n")
    pem.chmod(0o644)
    with pytest.raises(CommandError, match=r"--mqtt-key: .*mode 644.*chmod 600"):
        private_key(pem)
    pem.chmod(0o600)
    assert private_key(pem) == pem.read_text()
    pem.write_text("-----BEGIN ENCRYPTED PRIVATE KEY-----\nMIIB\n-----END ENCRYPTED PRIVATE KEY-----\n")
    with pytest.raises(CommandError, match="is encrypted"):
        private_key(pem)
    pem.write_text("-----BEGIN PRIVATE KEY-----\n" + 2048 * "A")
    with pytest.raises(CommandError, match="a board keeps 2048"):
        private_key(pem)
    with pytest.raises(CommandError, match="holds no certificate"):
        certificate(pem, "--mqtt-cert")


def test_a_board_that_starts_while_it_is_told_is_told_again(line, quick):
    board, port = line
    board.deaf = 2
    assert module.provision(port, 115_200, CredentialsChange(device="rm1")) is ExitCode.OK
    assert board.told == [{"device": "rm1"}]


def test_a_refusal_is_in_the_boards_words(line, quick):
    board, port = line
    board.refuses = "the arm moves"
    with pytest.raises(CommandError, match="the device refused: the arm moves"):
        module.provision(port, 115_200, CredentialsChange(device="rm1"))


def test_silence_names_what_to_look_at(line, quick):
    board, port = line
    board.deaf = 100
    with pytest.raises(CommandError, match=r"no answer in 0\.5 s: is it the right --serial port"):
        module.provision(port, 115_200, CredentialsChange(device="rm1"))


def test_a_port_that_is_not_there_is_named(capsys, tmp_path):
    assert run(["device", "provision", "--serial", str(tmp_path / "tty"), "--device", "rm1"]) is ExitCode.FAILED
    assert "cannot open" in capsys.readouterr().err


def test_a_factory_reset_asks_first_and_then_says_only_that(line, capsys, monkeypatch):
    board, port = line
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    assert run(["device", "provision", "--serial", port, "--factory-reset"]) is ExitCode.USAGE
    assert "--yes" in capsys.readouterr().err
    assert run(["device", "provision", "--serial", port, "--factory-reset", "--device", "rm1"]) is ExitCode.USAGE
    assert board.told == []
    assert run(["device", "provision", "--serial", port, "--factory-reset", "--yes"]) is ExitCode.OK
    assert board.told == [{"factory_reset": True}]


def test_no_option_takes_a_password():
    from gemelo.tools.cli.commands import COMMANDS
    from gemelo.tools.cli.completion import options_of

    (command,) = [each for each in COMMANDS if each.words == ("device", "provision")]
    assert [option for option in options_of(command) if "pass" in option] == []


def test_a_password_comes_from_the_environment_a_terminal_or_a_pipe(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    assert password("password", "SECRET", {"SECRET": ""}) == ""
    assert password("password", "SECRET", {"SECRET": "of the gateway", "OWN": "own"}, "OWN") == "own"
    assert password("password", "SECRET", {"SECRET": "of both"}, "OWN") == "of both"
    monkeypatch.setattr("sys.stdin", io.StringIO("first\nsecond\n"))
    assert [password("password", "SECRET", {}) for _ in range(2)] == ["first", "second"]
    with pytest.raises(CommandError, match=r"\$SECRET"):
        password("password", "SECRET", {})
    monkeypatch.setattr("sys.stdin", Terminal())
    monkeypatch.setattr(getpass, "getpass", lambda prompt: f"asked for {prompt}")
    assert password("password", "SECRET", {}) == "asked for password (empty: none): "


@pytest.mark.parametrize(
    ("credentials", "reason"),
    [
        (CredentialsChange(), "nothing to tell"),
        (CredentialsChange(wifi_ssid="ñ" * 17), "34 bytes"),
        (CredentialsChange(wifi_ssid="lab", wifi_password="short"), "5 characters, not 8 to 63"),
        (CredentialsChange(mqtt_uri="10.0.0.2"), "mqtt://host:1883"),
        (CredentialsChange(mqtt_certificate="PEM"), "belong together"),
        (CredentialsChange(serial_baud="300"), "300 is not within 9600 to 3000000"),
    ],
)
def test_what_no_board_could_use_is_not_sent(credentials, reason):
    with pytest.raises(CommandError, match=reason) as error:
        require_sound(credentials)
    assert error.value.code is ExitCode.USAGE


def test_a_certificate_is_a_pem_file(tmp_path):
    pem, other = tmp_path / "ca.pem", tmp_path / "ca.der"
    pem.write_text("-----BEGIN CERTIFICATE-----\nMIIB\n-----END CERTIFICATE-----\n")
    other.write_bytes(b"\x30\x82\xff")
    assert certificate(pem) == pem.read_text()
    assert certificate(None) is None
    for path in (other, tmp_path / "none.pem"):
        with pytest.raises(CommandError, match="--mqtt-ca"):
            certificate(path)
