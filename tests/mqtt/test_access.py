"""The access to a broker: from the deployment, files of mode 600 and the environment, and never shown."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from gemelo.libraries.credentials.authority import Authority
from gemelo.libraries.credentials.private_files import AccessError
from gemelo.libraries.mqtt import secure_folder
from gemelo.libraries.mqtt.access import device_access, gateway_access, read_secret
from gemelo.schemas.deployment import Broker, MqttSection
from tests.openssl import openssl

STRANGE = MqttSection(broker=Broker.EXTERNAL, host="broker.lan", port=8883)


@pytest.fixture
def password(tmp_path: Path) -> Path:
    path = tmp_path / "password"
    secure_folder.write(path, "of the file\nsecond line\n")
    return path


def test_a_password_is_the_first_line_of_its_file_and_the_environment_wins(password):
    section = replace(STRANGE, user="ada", password_file=str(password))
    assert gateway_access(section, {}).password == "of the file"
    assert gateway_access(section, {"GEMELO_MQTT_PASSWORD": "of the shell"}).password == "of the shell"
    assert gateway_access(STRANGE, {"GEMELO_MQTT_PASSWORD": "without a user"}).password == ""


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o602, 0o666])
def test_a_file_that_others_can_open_is_refused_with_chmod(password, mode):
    password.chmod(mode)
    with pytest.raises(AccessError, match=f"has mode {mode:03o}, so others can read .*: chmod 600 {password}"):
        read_secret(str(password))
    password.chmod(0o400)
    assert read_secret(str(password)) == "of the file"


def test_a_file_that_is_not_there_or_empty_is_named(tmp_path):
    with pytest.raises(AccessError, match=f"cannot read {tmp_path}/none: No such file"):
        read_secret(str(tmp_path / "none"))
    secure_folder.write(tmp_path / "empty", "\n")
    with pytest.raises(AccessError, match="empty holds no password in its first line"):
        read_secret(str(tmp_path / "empty"))


def test_the_device_has_its_own_user_else_that_of_the_gateway(password, tmp_path):
    section = replace(STRANGE, user="ada", password_file=str(password))
    assert device_access(section, "rm1", {}) == gateway_access(section, {})
    own = replace(section, device_user="arm")
    assert device_access(own, "rm1", {"GEMELO_MQTT_DEVICE_PASSWORD": "x", "GEMELO_MQTT_PASSWORD": "y"}).password == "x"
    secure_folder.make(tmp_path / "lock", ["broker.lan"], ["rm1"])
    locked = replace(STRANGE, secure_folder=str(tmp_path / "lock"))
    gateway, device = gateway_access(locked, {}), device_access(locked, "rm1", {})
    assert (gateway.user, device.user) == ("gateway", "rm1")
    assert gateway.tls is not None
    assert device.tls is not None
    assert gateway.password not in ("", device.password)
    for access in (gateway, device):
        assert access.password not in f"{access!r} {access}"


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"broker": Broker.EMBEDDED, "user": "ada"}, "`gemelo broker secure` writes"),
        ({"broker": Broker.MOSQUITTO, "tls": True}, "`gemelo broker secure` writes"),
        ({"ca": "ca.pem"}, "set mqtt.tls = true too"),
        ({"tls": True, "key": "client.key"}, "mqtt.key is the key of mqtt.certificate, which is not set"),
        ({"tls": True, "ca": "/nowhere/ca.pem"}, "mqtt.ca: cannot read /nowhere/ca.pem: No such file"),
        ({"tls": True, "ca": __file__}, "holds no certificate in PEM"),
    ],
)
def test_settings_that_contradict_each_other_are_named(changes, reason):
    with pytest.raises(AccessError) as error:
        gateway_access(replace(STRANGE, **changes), {})
    assert reason in str(error.value)


def test_a_certificate_of_ours_has_a_private_key_that_nobody_else_reads_and_no_password(tmp_path):
    certificate, key = tmp_path / "client.pem", tmp_path / "client.key"
    authority = tmp_path / "ca.pem"
    Authority(authority, tmp_path / "ca.key").sign_client("gateway", certificate, key)
    section = replace(STRANGE, tls=True, ca=str(authority), certificate=str(certificate), key=str(key))
    assert gateway_access(section, {}).has_certificate
    key.chmod(0o644)
    with pytest.raises(AccessError, match=f"chmod 600 {key}"):
        gateway_access(section, {})
    key.chmod(0o600)
    openssl("ec", "-aes128", "-passout", "pass:x", "-in", str(key), "-out", str(tmp_path / "locked.key"))
    with pytest.raises(AccessError, match=r"locked\.key is encrypted: take its password away"):
        gateway_access(replace(section, key=str(tmp_path / "locked.key")), {})
