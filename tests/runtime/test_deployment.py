"""Deployment files: overrides, defaults, and refusals that a builder can act on."""

from __future__ import annotations

from pathlib import Path

import pytest

from gemelo.libraries.runtime import deployment
from gemelo.libraries.runtime.deployment import DeploymentError, load_deployment, project_root, robot_name, when_silent
from gemelo.schemas.deployment import Broker, MqttSection


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "site.toml"


def test_the_pyproject_of_a_users_own_project_is_not_taken_for_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "web"\n')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(deployment, "__file__", str(tmp_path / ".venv/lib/python3.11/site-packages/gemelo/file.py"))
    with pytest.raises(DeploymentError, match=r"no deploy/local\.toml above this program or the working directory"):
        project_root()
    (tmp_path / "deploy").mkdir()
    (tmp_path / "deploy/local.toml").touch()
    assert project_root() == tmp_path


def test_without_anything_it_is_the_local_run() -> None:
    deployment = load_deployment(environ={})
    assert deployment.router.host == "127.0.0.1"
    assert deployment.paths.run == str(project_root() / ".gemelo" / "run")
    assert robot_name(deployment) == "rm1"


def test_the_argument_wins_over_the_environment_and_that_over_the_default(file: Path, tmp_path: Path) -> None:
    file.write_text("[router]\nport = 1\n")
    other = tmp_path / "other.toml"
    other.write_text("[router]\nport = 2\n")
    assert load_deployment(file, {"GEMELO_CONFIG": str(other)}).router.port == 1
    assert load_deployment(environ={"GEMELO_CONFIG": str(other)}).router.port == 2


def test_every_key_can_be_overridden_in_the_environment(file: Path) -> None:
    file.write_text('[paths]\nrun = "here"\n[parameters.planner]\nattempts = 3\n')
    environ = {
        "GEMELO_ROBOT": "urdf/parol6", "GEMELO_ROUTER_PORT": "7555", "GEMELO_MQTT_BROKER": "mosquitto",
        "GEMELO_VIEWER_WEB_PORT": "9191", "GEMELO_PATHS_OUT": "/elsewhere", "GEMELO_OTHER": "x",
    }  # fmt: skip
    deployment = load_deployment(file, environ)
    assert deployment.robot == str(project_root() / "urdf" / "parol6")
    assert deployment.router.port == 7555
    assert deployment.mqtt.broker is Broker.MOSQUITTO
    assert deployment.viewer.web_port == 9191
    assert (deployment.paths.run, deployment.paths.out) == (str(project_root() / "here"), "/elsewhere")
    assert deployment.parameters == {"planner": {"attempts": 3}}


def test_listening_and_connecting_addresses_are_two_settings_and_the_one_is_the_other_unless_said() -> None:
    assert MqttSection(host="10.0.0.2", port=8883).listening == ("10.0.0.2", 8883)
    section = MqttSection(host="127.0.0.1", port=1883, listen_host="0.0.0.0", listen_port=8883)
    assert section.listening == ("0.0.0.0", 8883)
    assert (section.host, section.port) == ("127.0.0.1", 1883)


def test_the_files_of_a_broker_are_relative_to_the_project_and_those_not_said_stay_so(file: Path) -> None:
    file.write_text('[mqtt]\nbroker = "external"\nuser = "ada"\npassword_file = "secret"\n')
    mqtt = load_deployment(file, {"GEMELO_MQTT_TLS": "true", "GEMELO_MQTT_CA": "/etc/ca.pem"}).mqtt
    assert mqtt.password_file == str(project_root() / "secret")
    assert (mqtt.ca, mqtt.certificate, mqtt.secure_folder) == ("/etc/ca.pem", "", "")
    assert mqtt.tls is True


@pytest.mark.parametrize(
    ("text", "environ", "reason"),
    [
        ("[mqtt]\npassword = 'x'\n", {}, r'unknown key "mqtt.password": did you mean "password_file"\?'),
        ("[router]\nprot = 1\n", {}, r'site.toml: unknown key "router.prot": did you mean "port"\?'),
        ("[ruoter]\nport = 1\n", {}, r'unknown key "ruoter": did you mean "router"\?'),
        ("[router]\nport = 'x'\n", {}, r"site.toml: .*int.*router\.port"),
        ("router = 5\n", {}, r"site.toml: .*object.*router"),
        ("[mqtt]\nbroker = 'emqx'\n", {}, r"site.toml: .*'emqx'.*mqtt\.broker"),
        ("[router\n", {}, r"site.toml, line 1: this is not TOML"),
        ('[paths]\nrun = "a\\u0000b"\n', {}, r'site.toml: key "paths.run" cannot be .* NUL'),
        ('robot = "a\\u0000b"\n', {}, r'site.toml: key "robot" cannot be .* NUL'),
        ('[parameters.logger]\nlog_dir = "\\u0000"\n', {}, r'key "parameters.logger.log_dir" cannot be .* NUL'),
        ("", {"GEMELO_ROUTER_PORT": "seven"}, r"with GEMELO_ROUTER_PORT from the environment.*int.*router\.port"),
    ],
)
def test_a_mistake_is_named(file: Path, text: str, environ: dict[str, str], reason: str) -> None:
    file.write_text(text)
    with pytest.raises(DeploymentError, match=reason):
        load_deployment(file, environ)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(DeploymentError, match=r"nowhere\.toml: there is no such file"):
        load_deployment(tmp_path / "nowhere.toml", {})


def test_only_what_is_on_this_machine_is_to_be_started_where_it_does_not_answer() -> None:
    for host in ("127.0.0.1", "localhost", "::1"):
        assert when_silent(host) == "start the twin with `make up`"
    assert when_silent("10.0.0.12").startswith("is that host on, does it answer `ping 10.0.0.12` from here")
