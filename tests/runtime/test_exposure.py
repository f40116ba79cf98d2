"""Listeners beyond this machine without TLS do not start, unless the deployment says `insecure`, and say so."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from gemelo.libraries.runtime.bus.router import router_setup
from gemelo.libraries.runtime.deployment import DeploymentError, exposure, is_loopback, load_deployment
from gemelo.schemas.reasons import because, remedy
from gemelo.tools.stack.start_check import exposed
from tests.runtime.locks import Lock
from tests.runtime.support import ROOT, free_port, until

OPEN = "0.0.0.0"


def deployment_file(folder: Path, section: str, **settings: object) -> Path:
    file = folder / "deployment.toml"
    values = {key: f'"{value}"' if isinstance(value, str) else str(value).lower() for key, value in settings.items()}
    lines = [f"[{section}]", *(f"{key} = {value}" for key, value in values.items()), "[paths]", f'run = "{folder}/run"']
    file.write_text("\n".join(lines))
    return file


@pytest.mark.parametrize("host", ["127.0.0.1", "127.8.9.1", "::1", "[::1]", "localhost"])
def test_loopback_needs_nothing(host):
    assert is_loopback(host)
    assert exposure("router", host, is_locked=False, is_insecure=False) is None


@pytest.mark.parametrize("host", [OPEN, "::", "10.0.0.1", "lab.example", "", "localhost.example"])
def test_any_other_address_without_tls_is_refused_with_the_remedy(host):
    with pytest.raises(DeploymentError, match=r"write insecure = true in \[router\]") as caught:
        exposure("router", host, is_locked=False, is_insecure=False)
    mend, variable = remedy("certificates_for_router"), "GEMELO_ROUTER_INSECURE"
    exposed_there = because("deployment.exposed", mend, section="router", host=host, variable=variable)
    assert caught.value.reason == exposed_there
    is_said = exposure("router", host, is_locked=False, is_insecure=True)
    assert is_said == because("deployment.insecure", section="router", host=host)
    assert exposure("router", host, is_locked=True, is_insecure=False) is None


@pytest.mark.parametrize(
    ("section", "host"), [("router", "host"), ("router", "listen_host"), ("mqtt", "listen_host"), ("panel", "host"),
                          ("viewer", "host")],
)  # fmt: skip
def test_make_up_names_every_open_port_that_others_reach(tmp_path, section, host):
    assert exposed(load_deployment(environ={})) == []
    (said,) = map(str, exposed(load_deployment(deployment_file(tmp_path, section, **{host: OPEN}), {})))
    assert said.startswith(f"[{section}] would listen on {OPEN}, beyond this machine, without TLS")
    assert exposed(load_deployment(deployment_file(tmp_path, section, **{host: OPEN}, insecure=True), {})) == []


@pytest.mark.parametrize(
    ("module", "section", "more"),
    [("gemelo.services.router.main", "router", {}), ("gemelo.services.broker.main", "mqtt", {}),
     ("gemelo.services.visualizer.viewer", "viewer", {"mode": "web"})],
)  # fmt: skip
def test_each_process_refuses_by_itself(tmp_path, module, section, more):
    file = deployment_file(tmp_path, section, host=OPEN, port=free_port(), **more)
    done = subprocess.run(
        [sys.executable, "-m", module, "--config", str(file)], cwd=ROOT, capture_output=True, text=True, timeout=20.0
    )
    assert done.returncode == 1
    assert f"[{section}] would listen on {OPEN}" in done.stdout + done.stderr


def test_an_insecure_router_starts_and_says_so(tmp_path):
    file = deployment_file(tmp_path, "router", listen_host=OPEN, port=free_port(), insecure=True)
    command = [sys.executable, "-m", "gemelo.services.router.main", "--config", str(file)]
    process = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True)
    assert until((tmp_path / "run/router.ready").exists, 60.0)
    process.terminate()
    _, said = process.communicate(timeout=60.0)
    assert "INSECURE: [router] listens on 0.0.0.0 without TLS (insecure = true)" in said


def test_a_configuration_counts_as_locked_only_with_certificates_and_permissions(tmp_path):
    file = Lock(tmp_path / "lock", roles=()).write_router(7000)
    wanted = load_deployment(environ={"GEMELO_ROUTER_CONFIGURATION": str(file)}).router
    assert router_setup(wanted)[1:] == (("127.0.0.1", 7000), True)
    sound = file.read_text()
    for harm in (
        ('"enable_mtls": true', '"enable_mtls": false'),
        ('"default_permission": "deny"', '"default_permission": "allow"'),
        ('"access_control": {"enabled": true', '"access_control": {"enabled": false'),
        ("tls/127", "tcp/127"),
    ):
        assert harm[0] in sound
        file.write_text(sound.replace(*harm))
        assert router_setup(wanted)[2] is False
    file.write_text("{ listen: ")
    with pytest.raises(DeploymentError, match=r"router\.configuration: .*router\.json5 cannot be used"):
        router_setup(wanted)
    with pytest.raises(DeploymentError, match=r"needs router\.configuration"):
        router_setup(load_deployment(environ={"GEMELO_ROUTER_TLS": "true"}).router)
