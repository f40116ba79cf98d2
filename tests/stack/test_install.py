"""`gemelo deploy install` over a real ssh, up to what systemd would do; then the host's own files move its arm."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.hosts.checks import load_site
from gemelo.tools.hosts.layout import processes
from gemelo.tools.hosts.render import rendered
from gemelo.tools.stack.stack import free_ports
from tests.optional import need
from tests.runtime.support import until
from tests.stack.other_host import OtherHost

SITE = """
project = "{project}"
config = "/etc/gemelo"
[router]
host = "one"
port = {router}
[broker]
host = "one"
port = {broker}
[robots.rm1]
folder = "urdf/rm1"
[hosts.one]
address = "127.0.0.1"
roles = ["operator"]
[hosts.one.services]
rm1 = ["stepper_gateway", "virtual_esp32", "state_publisher", "planner"]
"""
SITE_THERE = "/var/lib/gemelo/lab.toml"
READY = 90.0  # [s]


class Lab:
    """A site of that host, and the commands of who deploys it."""

    def __init__(self, host: OtherHost, folder: Path) -> None:
        router, broker = free_ports(2)
        self.host, self.file, self.out = host, folder / "lab.toml", folder / "out"
        self.file.write_text(SITE.format(project=project_root(), router=router, broker=broker))
        self.site = load_site(self.file, project_root())

    def deploy(self, *words: str) -> subprocess.CompletedProcess[str]:
        """`gemelo deploy` here."""
        command, *more = words
        return subprocess.run(
            [sys.executable, "-m", "gemelo.tools.cli.main", "deploy", command, str(self.file), *more],
            cwd=project_root(), env=os.environ | {"PATH": self.host.path, "GEMELO_PATHS_OUT": str(self.out)},
            capture_output=True, text=True, timeout=120.0, check=False,
        )  # fmt: skip

    @contextmanager
    def changed(self, *changes: tuple[str, str]) -> Iterator[None]:
        """The site's file with those texts replaced, and rendered so; then both as they were."""
        before = text = self.file.read_text()
        for old, new in changes:
            text = text.replace(old, new)
        try:
            self._render(text)
            yield
        finally:
            self._render(before)

    def _render(self, text: str) -> None:
        self.file.write_text(text)
        done = self.deploy("render")
        assert done.returncode == 0, done.stderr

    def there(self, *words: str) -> subprocess.CompletedProcess[str]:
        """A command there, by the user of the services, with the deployment of who works there."""
        return self.host.run(f"cd / && runuser -u gemelo -- env GEMELO_CONFIG=/etc/gemelo/rm1.toml {' '.join(words)}")


@pytest.fixture(scope="module")
def host(tmp_path_factory: pytest.TempPathFactory) -> Iterator[OtherHost]:
    host = OtherHost(tmp_path_factory.mktemp("host"))
    yield host
    host.close()


@pytest.fixture(scope="module")
def lab(host: OtherHost, tmp_path_factory: pytest.TempPathFactory) -> Lab:
    lab = Lab(host, tmp_path_factory.mktemp("lab"))
    for command in ("render", "keys"):
        done = lab.deploy(command)
        assert done.returncode == 0, done.stderr
    return lab


@pytest.fixture(scope="module")
def installed(lab: Lab) -> Lab:
    done = lab.deploy("install", "one")
    assert done.returncode == 0, f"{done.stdout}{done.stderr}{lab.host.log}"
    return lab


def test_a_dry_run_does_nothing_there(lab: Lab) -> None:
    done = lab.deploy("install", "one", "--dry-run")
    assert ["root@127.0.0.1" in line for line in done.stdout.splitlines()] == [True] * 4
    assert not lab.host.calls.exists()


def test_where_gemelo_cannot_be_run_nothing_is_copied_and_the_remedy_is_said(lab: Lab) -> None:
    with lab.changed((f'project = "{project_root()}"', 'project = "/opt/nowhere"'), ("/etc/gemelo", "/etc/elsewhere")):
        done = lab.deploy("install", "one")
    assert done.returncode == 1
    assert "gemelo cannot run /opt/nowhere/.venv/bin/gemelo on one: `make setup` in /opt/nowhere" in done.stderr
    assert lab.host.run("ls /etc/elsewhere").stdout == ""


def test_where_the_robots_own_files_are_missing_nothing_is_copied_and_the_remedy_is_said(lab: Lab) -> None:
    """An arm or cell of one's own is not in what a host has installed."""
    own = project_root() / "urdf/own_of_test"
    own.mkdir()
    try:
        (own / "cell.toml").write_text((project_root() / "urdf/rm1/cell.toml").read_text())
        for file in (project_root() / "urdf/rm1").iterdir():
            if file.name != "cell.toml":
                (own / file.name).symlink_to(file)
        own.chmod(0o700)  # of root, so that the services' user has none of it
        with lab.changed(('"urdf/rm1"', '"urdf/rm1"\ncell = "urdf/own_of_test/cell.toml"')):
            done = lab.deploy("install", "one")
    finally:
        shutil.rmtree(own)
    assert done.returncode == 1
    assert f"gemelo cannot read {own}/cell.toml on one: `rsync -a --relative urdf/own_of_test root@" in done.stderr
    assert lab.host.run("ls /etc/gemelo").stdout == ""


def test_the_folder_is_the_services_users_alone_and_the_authority_stays_here(installed: Lab) -> None:
    listed = installed.host.run("cd /etc/gemelo && find . -printf '%u %m %P\\n'").stdout.splitlines()
    found = {path: (user, int(mode, 8)) for user, mode, path in (line.split(" ", 2) for line in listed)}
    assert {user for user, _ in found.values()} == {"gemelo"}
    assert not any(mode & 0o077 for _, mode in found.values())
    folder = installed.out / "deploy/lab/one"
    assert set(found) == {str(file.relative_to(folder)) for file in folder.rglob("*")} | {""}
    assert not any("authority" in path or path.endswith("ca.key") for path in found)
    assert installed.host.run("stat -c '%U %a' /var/lib/gemelo").stdout == "gemelo 700\n"


def test_the_user_is_made_there_and_not_here(installed: Lab) -> None:
    assert installed.host.run("id -un gemelo").stdout == "gemelo\n"
    here = Path("/etc/passwd").read_text()
    assert installed.host.run("cat /etc/passwd").stdout != here


def test_systemd_is_given_every_unit_as_rendered_and_told_to_start_them(installed: Lab) -> None:
    wanted = {name: text for name, text in rendered(installed.site, "one").items() if name.startswith("systemd/")}
    for name, text in wanted.items():
        assert installed.host.run(f"cat /etc/systemd/system/{name.removeprefix('systemd/')}").stdout == text
    assert len(wanted) == len(list(processes(installed.site, "one"))) + 2  # the target, and the firewall
    assert installed.host.calls.read_text().splitlines()[-3:] == [
        "daemon-reload", "enable --now gemelo.target", "restart gemelo-firewall.service"
    ]  # fmt: skip


def test_what_is_renewed_goes_out_again_by_the_same_command(installed: Lab) -> None:
    before = installed.host.run("cat /etc/gemelo/keys/planner.pem").stdout
    assert installed.deploy("keys", "--renew-authority").returncode == 0
    assert installed.deploy("install", "one").returncode == 0
    after = installed.host.run("cat /etc/gemelo/keys/planner.pem").stdout
    assert after != before
    assert after == (installed.out / "deploy/lab/one/keys/planner.pem").read_text()


def test_the_key_of_a_role_that_has_left_goes_from_the_host_and_what_others_put_there_stays(installed: Lab) -> None:
    own = ("own.txt", "systemd/own.service", "broker/own.password", "own/keys/own.pem")
    gone = ("keys/viewer.pem", "keys/viewer.key")
    installed.host.run(f"cd /etc/gemelo && mkdir -p own/keys && touch {' '.join((*own, *gone))}")
    assert installed.deploy("install", "one").returncode == 0
    left = installed.host.run("cd /etc/gemelo && find . -type f -printf '%P\\n'").stdout.splitlines()
    assert not set(gone) & set(left)
    assert set(own) <= set(left)
    assert "keys/operator.key" in left
    installed.host.run(f"cd /etc/gemelo && rm -r own {' '.join(own[:3])}")


def test_a_service_that_has_left_the_host_is_stopped_there_and_its_unit_goes_but_no_other(installed: Lab) -> None:
    """Else two gateways would lead one arm until the next boot."""
    text, units = installed.file.read_text(), "/etc/systemd/system"
    left = "gemelo-rm1-logger.service"
    try:
        installed.file.write_text(text.replace('"planner"]', '"planner", "logger"]'))
        for _ in range(2):
            for command in (("render",), ("keys",), ("install", "one")):
                done = installed.deploy(*command)
                assert done.returncode == 0, done.stderr
            if installed.file.read_text() != text:
                assert installed.host.run(f"ls {units}/{left} /etc/gemelo/systemd/{left}").returncode == 0
                installed.host.run(f"echo '[Unit]' >{units}/gemelo-of-others.service")
            installed.file.write_text(text)
    finally:
        installed.file.write_text(text)
    calls = installed.host.calls.read_text().splitlines()
    firewall = "restart gemelo-firewall.service"
    assert calls[-4:] == [f"stop {left}", "daemon-reload", "enable --now gemelo.target", firewall]
    assert [call for call in calls if call.startswith("stop")] == [f"stop {left}"]
    for folder in (units, "/etc/gemelo/systemd"):
        assert installed.host.run(f"ls {folder}/{left}").returncode != 0
    assert installed.host.run(f"rm {units}/gemelo-of-others.service").returncode == 0


def test_its_files_start_the_stack_as_that_user_and_who_works_there_moves_it(installed: Lab, tmp_path: Path) -> None:
    need("mosquitto")
    gemelo = f"{installed.site.project}/.venv/bin/gemelo"
    installed.host.run(f"install -m 644 {installed.file} {SITE_THERE}")
    # Without systemd, as docs/several_hosts.md says; process-compose's own server is a socket, as in .pc_env.
    server = installed.host.start(
        "cd /var/lib/gemelo && exec runuser -u gemelo -- env PC_SOCKET_PATH=/var/lib/gemelo/pc.sock PC_USE_UDS=1 "
        "PC_LOG_FILE=/var/lib/gemelo/pc.log "
        f"{installed.site.project}/.venv/bin/process-compose up -t=false -f /etc/gemelo/process-compose.yaml",
        log=tmp_path / "log",
    )  # fmt: skip
    try:
        said: list[subprocess.CompletedProcess[str]] = []

        def is_well() -> bool:
            said.append(installed.there(gemelo, "deploy", "status", SITE_THERE))
            return said[-1].returncode == 0

        assert until(is_well, READY), said[-1].stdout + said[-1].stderr + (tmp_path / "log").read_text()
        assert "certificates: one 365 days, yours 365 days" in said[-1].stdout
        moved = installed.there(gemelo, "move", "--named", "ready")
        assert moved.returncode == 0, moved.stdout + moved.stderr
    finally:
        installed.there("env PC_SOCKET_PATH=/var/lib/gemelo/pc.sock PC_USE_UDS=1",
                        f"{installed.site.project}/.venv/bin/process-compose down")  # fmt: skip
        try:
            server.wait(timeout=20.0)
        finally:
            server.send_signal(signal.SIGKILL)
