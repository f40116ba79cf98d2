"""The folder of `gemelo broker secure`: private, kept over a second run, and nothing that git would take."""

from __future__ import annotations

import re
import stat
import subprocess

import pytest

from gemelo.libraries.credentials.private_files import AccessError
from gemelo.libraries.mqtt import secure_folder
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.optional import need

LONGEST_ON_A_BOARD = 2048  # [bytes] of mqtt_ca in firmware/PROTOCOL.md


def made(folder, *words):
    return run(["broker", "secure", "--folder", str(folder), "--host", "10.0.0.2", "broker.lan", *words])


def test_everything_is_for_its_owner_alone_and_git_ignores_it(tmp_path, capsys):
    need("git")
    folder = tmp_path / "repository" / "lock"
    folder.parent.mkdir()
    subprocess.run(["git", "init", "-q", folder.parent], check=True)
    assert made(folder, "--device", "rm1") is ExitCode.OK
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert {stat.S_IMODE(file.stat().st_mode) for file in folder.iterdir()} == {0o600}
    status = subprocess.run(["git", "-C", folder.parent, "status", "--porcelain"], capture_output=True, check=True)
    assert status.stdout == b""
    said = capsys.readouterr().out
    for user in ("gateway", "rm1"):
        assert secure_folder.password_of(folder, user) not in said
    assert 'host = "10.0.0.2"' in said
    assert f'secure_folder = "{folder}"' in said


def test_a_second_run_keeps_authority_and_passwords_and_adds_a_device(tmp_path):
    assert made(tmp_path, "--device", "rm1") is ExitCode.OK
    kept = {name: (tmp_path / name).read_text() for name in ("ca.pem", "ca.key", "gateway.password", "rm1.password")}
    certificate = (tmp_path / "server.pem").read_text()
    assert made(tmp_path, "--device", "parol6") is ExitCode.OK
    assert {name: (tmp_path / name).read_text() for name in kept} == kept
    assert (tmp_path / "server.pem").read_text() != certificate
    assert secure_folder.devices_in(tmp_path) == ("parol6", "rm1")
    assert {line.split(":")[0] for line in (tmp_path / "users").read_text().splitlines()} == {
        "gateway",
        "parol6",
        "rm1",
    }
    assert re.findall(r"^user (\w+)$", (tmp_path / "acl").read_text(), re.M) == ["gateway", "parol6", "rm1"]


def test_the_certificate_has_every_name_and_the_authority_fits_into_a_board(tmp_path):
    assert made(tmp_path, "--device", "rm1") is ExitCode.OK
    shown = subprocess.run(
        ["openssl", "x509", "-in", tmp_path / "server.pem", "-noout", "-ext", "subjectAltName"],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    assert "IP Address:10.0.0.2, DNS:broker.lan, DNS:localhost, IP Address:127.0.0.1" in shown
    assert (tmp_path / "ca.pem").stat().st_size <= LONGEST_ON_A_BOARD


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--device", "gateway"], '"gateway" cannot be the name of a device'),
        (["--device", "a/b"], '"a/b" cannot be the name of a device'),
        (["--device", "rm1", "--host", "a, DNS:b"], "is neither a host name nor an IP address"),
        (["--device", "rm1", "rm2", "--serial", "/dev/null"], "--serial tells one board: give one --device, not 2"),
        (["--device", "rm1", "--wifi-ssid", "lab"], "give its --serial too"),
    ],
)
def test_what_cannot_be_is_refused_by_name(tmp_path, capsys, words, reason):
    assert made(tmp_path, *words) in (ExitCode.FAILED, ExitCode.USAGE)
    assert reason in capsys.readouterr().err


def test_no_option_takes_a_password():
    from gemelo.tools.cli.commands import COMMANDS
    from gemelo.tools.cli.completion import options_of

    (command,) = [each for each in COMMANDS if each.words == ("broker", "secure")]
    assert [option for option in options_of(command) if "pass" in option] == []


def test_a_folder_that_was_never_made_is_named_with_the_command(tmp_path):
    with pytest.raises(AccessError, match=r"has no ca\.pem: `gemelo broker secure` makes it"):
        secure_folder.listener(tmp_path)
