"""Rendered files can be read by their programs, and nothing that a person writes becomes more than a value in them."""

from __future__ import annotations

import json
import re
import shlex
import tomllib
from pathlib import Path

import pytest
import yaml
import zenoh
from hypothesis import HealthCheck, example, given
from hypothesis import strategies as st

from gemelo.libraries.runtime.deployment import load_deployment, project_root
from gemelo.libraries.runtime.process.readiness import GOES_ON
from gemelo.schemas.site import Site
from gemelo.tools.hosts import install
from gemelo.tools.hosts.checks import load_site
from gemelo.tools.hosts.containers import IN_IMAGE
from gemelo.tools.hosts.firewall import UNIT_NAME, ports
from gemelo.tools.hosts.layout import Process, processes, robots
from gemelo.tools.hosts.render import rendered, write
from gemelo.tools.hosts.site_file import SiteError
from tests.hosts.sites import EXAMPLE, changed, escaped, site
from tests.profiles import examples

NASTY = (
    'a"b', "a'b", "a b", "ñandú/机器人", "a;reboot", "a && b", "`id`", "a#b", "{x}", "a: b", "- a", "a\\", "$(id)",
    "%h", "a\nExecStart=/bin/evil", "a\r\n[Service]", "\x00", "\u2028x", "{{.Env}}", "!!python/object", "${HOME}",
)  # fmt: skip
texts = st.one_of(st.sampled_from(NASTY), st.text(max_size=30), st.text(" \"'\\$%;`#[]{}=\n", max_size=12))
Unit = list[tuple[str, str, str]]  # section, key, value


def directives(text: str) -> Unit:
    """A unit's directives as systemd.syntax(7) reads them; a continued line would join the next."""
    section, found = "", []
    for line in text.split("\n"):
        if not line or line.startswith(("#", ";")):
            continue
        if header := re.fullmatch(r"\[(.+)\]", line):
            section = header[1]
            continue
        assert not line.endswith("\\"), line
        key, equals, value = line.partition("=")
        assert equals, line
        found.append((section, key, value))
    return found


def words(value: str) -> list[str]:
    """The words of a value, unquoted, with the specifiers that systemd knows resolved."""
    lexer = shlex.shlex(value, posix=True)
    lexer.whitespace_split, lexer.commenters, lexer.quotes = True, "", '"'
    found = list(lexer)
    assert not any(re.search("%(?!%)", word.replace("%%", "")) for word in found), value
    return [word.replace("%%", "%") for word in found]


def keys(unit: Unit) -> list[tuple[str, str]]:
    return [(section, key) for section, key, _ in unit]


def values(unit: Unit, key: str) -> list[str]:
    return [value for _, each, value in unit if each == key]


def require_nothing_injected(lab: Site, plain: Site) -> None:
    """The files of `lab` say the same things as those of `plain`, with its own values."""
    for host in lab.hosts:
        files, ordinary = rendered(lab, host), rendered(plain, host)
        assert files.keys() == ordinary.keys()
        for process in processes(lab, host):
            name = f"systemd/{process.unit}.service"
            unit = directives(files[name])
            assert keys(unit) == keys(directives(ordinary[name]))
            (command,) = values(unit, "ExecStart")
            assert words(command.removeprefix(":")) == [f"{lab.project}/.venv/bin/{process.program}"]
            assert words(values(unit, "ReadWritePaths")[0]) == [lab.state]
            assert words(values(unit, "Environment")[0])[0].startswith(f"GEMELO_CONFIG={lab.config}/")
            assert values(unit, "User") == [lab.user]
        whole, of_plain = (directives(each["systemd/gemelo.target"]) for each in (files, ordinary))
        assert whole == of_plain
        units = [f"{process.unit}.service" for process in processes(lab, host)]
        assert values(whole, "Wants")[0].split() == [*units, *([UNIT_NAME] if ports(lab, host) else [])]
        supervised = yaml.safe_load(files["process-compose.yaml"])["processes"]
        contained = yaml.safe_load(files["compose.yaml"])["services"]
        for process in processes(lab, host):
            made = supervised[process.unit]
            assert shlex.split(made["command"]) == ["exec", f"{lab.project}/.venv/bin/{process.program}", "2>&1"]
            probe = made["readiness_probe"]["exec"]["command"]
            assert shlex.split(probe) == probe_words(lab, process, lab.project)
            made = contained[process.unit]
            assert made["command"] == [f"{IN_IMAGE}/.venv/bin/{process.program}"]
            assert made["healthcheck"]["test"][0] == "CMD-SHELL"
            assert shlex.split(made["healthcheck"]["test"][1]) == probe_words(lab, process, IN_IMAGE)
            mounts = [(each["source"], each["target"]) for each in made["volumes"]]
            assert mounts == [(lab.config, lab.config), (lab.state, lab.state)]
            assert made["environment"]["GEMELO_CONFIG"].startswith(f"{lab.config}/")
        require_same_image(files["Containerfile"], ordinary["Containerfile"], lab.user)
        assert "$" not in files["process-compose.yaml"] + files["compose.yaml"]
        if "mosquitto.conf" in files:
            of_lab, of_plain = (text.splitlines() for text in (files["mosquitto.conf"], ordinary["mosquitto.conf"]))
            assert [line.split(" ")[0] for line in of_lab] == [line.split(" ")[0] for line in of_plain]


def probe_words(lab: Site, process: Process, project: str) -> list[str]:
    run = f"GEMELO_PATHS_RUN={lab.state}/{process.robot or 'host'}/run"
    return [run, f"{project}/deploy/probe", process.service.name, "restart"]


def require_same_image(text: str, plain: str, user: str) -> None:
    """All lines are those of `plain`, but for the user's name, which is a word of its own wherever it stands."""
    for line, ordinary in zip(text.split("\n"), plain.split("\n"), strict=True):
        assert line.startswith("#") == ordinary.startswith("#")
        words_of_plain = [user if word == "gemelo" else word for word in ordinary.split(" ")]
        assert line.startswith("#") or line.split(" ") == words_of_plain


def require_readable(lab: Site, folder: Path) -> None:
    for host in lab.hosts:
        for robot in robots(lab, host):
            file = folder / f"{robot}.toml"
            file.write_text(rendered(lab, host)[f"{robot}.toml"], encoding="utf-8")
            read = load_deployment(file, {})
            assert read.router.ca == f"{lab.config}/keys/ca.pem"
            assert read.paths.run == f"{lab.state}/{robot}/run"
            assert read.serial.device == lab.robots[robot].serial


@examples(quick=20, full=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.fixed_dictionaries({}, optional=dict.fromkeys(("project", "config", "state", "user", "serial"), texts)))
@example({"project": "/opt/a \"b\" 'c' ; ñ", "state": "/var/my 'state", "serial": "/dev/tty ACM#0"})
@example({"config": "/etc/x\nExecStart=/bin/evil"})
def test_whatever_a_person_writes_is_refused_or_stays_one_value(tmp_path, written):
    top = "".join(f"{key} = {escaped(rooted(key, text))}\n" for key, text in written.items() if key != "serial")
    file = changed(tmp_path, "[router]", f"{top}[router]")
    if "serial" in written:
        robot = f'[robots.rm1]\nwire = "serial"\nserial = {escaped(written["serial"])}'
        file.write_text(file.read_text(encoding="utf-8").replace("[robots.rm1]", robot), encoding="utf-8")
    try:
        lab = load_site(file, project_root())
    except (SiteError, UnicodeEncodeError):
        return
    look = next(command[2] for command in install_commands(lab, "brain", tmp_path) if "rsync" in command[2])
    assert f"{lab.project}/.venv/bin/gemelo" in shlex.split(look)
    assert f"{lab.project}/urdf/rm1/robot.toml" in shlex.split(look)
    assert shlex.split(look).count("exit") == 4
    wire = '[robots.rm1]\nwire = "serial"' if "serial" in written else "[robots.rm1]"
    require_nothing_injected(lab, site(tmp_path, "[robots.rm1]", wire))
    require_readable(lab, tmp_path)


addresses = st.one_of(
    texts,
    texts.map("fe80::1%{}".format),
    st.sampled_from(("fe80::1%eth0", "fe80::1%eth0 x", "10.0.0.9", "lab-1.example")),
)


@examples(quick=20, full=80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(("cell", "brain")), st.sampled_from(("address", "listen")), addresses)
@example("cell", "listen", "fe80::1%a b")
@example("brain", "address", "fe80::1%eth0")
def test_whatever_is_written_as_an_address_is_refused_or_stays_one_word(tmp_path, host, key, written):
    header = f"[hosts.{host}.services]"
    if key == "address":
        own = {"cell": '"10.0.0.11"', "brain": '"10.0.0.12"'}[host]
        file = changed(tmp_path, own, escaped(written))
    else:
        file = changed(tmp_path, header, f"listen = {escaped(written)}\n{header}")
    try:
        lab = load_site(file, project_root())
    except (SiteError, UnicodeEncodeError):
        return
    require_nothing_injected(lab, site(tmp_path))
    require_readable(lab, tmp_path)
    at = lab.hosts[host].listen or lab.hosts[host].address
    files = rendered(lab, host)
    if "mosquitto.conf" in files:
        (listener,) = (line for line in files["mosquitto.conf"].splitlines() if line.startswith("listener"))
        assert listener.split() == ["listener", "8883", at]
    if "router.json5" in files:
        (endpoint,) = json.loads(files["router.json5"])["listen"]["endpoints"]
        assert endpoint == f"tls/[{at}]:7447" if ":" in at else f"tls/{at}:7447"
    shown = install_commands(lab, host, tmp_path)
    assert [command[1].partition("@")[2] for command in shown if command[0] == "ssh"] == [lab.hosts[host].address] * 3
    assert not any(word.startswith("-") for command in shown for word in command[1:2] if command[0] == "ssh")


def install_commands(lab: Site, host: str, folder: Path) -> tuple[tuple[str, ...], ...]:
    for name in ("systemd", "keys"):
        (folder / name).mkdir(exist_ok=True)
    return install.commands(lab, host, folder)


def rooted(key: str, text: str) -> str:
    return text if key == "user" or text.startswith("/") else f"/{text}"


@pytest.mark.parametrize("name", ["mi brazo ñ", "a'b", 'a"b', "a;b #c"])
def test_a_robots_folder_may_have_any_printable_name(tmp_path, name):
    project = tmp_path / "project"
    project.mkdir()
    (project / name).symlink_to(project_root() / "urdf/rm1")
    lab = load_site(changed(tmp_path, '"urdf/rm1"', escaped(name)), project)
    file = tmp_path / "rm1.toml"
    file.write_text(rendered(lab, "cell")["rm1.toml"], encoding="utf-8")
    assert load_deployment(file, {}).robot == str(project_root() / name)


@examples(quick=15, full=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(texts.filter(lambda text: not re.fullmatch("[a-z0-9][a-z0-9_-]{0,30}", text)))
def test_a_name_of_a_host_or_robot_that_is_not_plain_is_refused(tmp_path, name):
    for old, new in (("[hosts.desk]", "[hosts.{}]"), ("[robots.rm1]", "[robots.{}]")):
        with pytest.raises((SiteError, UnicodeEncodeError)):
            site(tmp_path, old, new.format(escaped(name)))


@examples(quick=20, full=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(texts.filter(lambda text: "/" not in text and "\0" not in text and 0 < len(text.encode(errors="replace")) < 250))
@example("lab-2")
@example("lab\n")
@example("ñandú")
@example("lab x")
@example("")
def test_a_name_of_a_site_is_plain_or_refused(tmp_path, name):
    file = tmp_path / f"{name}.toml"
    try:
        file.write_text(EXAMPLE.read_text(encoding="utf-8"), encoding="utf-8")
    except UnicodeEncodeError:  # half a character of UTF-16: no file can have that name
        return
    try:
        lab = load_site(file, project_root())
    except SiteError as error:
        said = str(error).removeprefix(str(file))
        assert said == f", line 1: {file.stem!r} cannot be the name of a site: {said.partition('site: ')[2]}"
        return
    assert re.fullmatch("[a-z0-9][a-z0-9_-]{0,30}", lab.name)
    require_nothing_injected(lab, site(tmp_path))


def test_the_example_is_rendered_hardened_and_readable(tmp_path):
    lab = site(tmp_path)
    require_nothing_injected(lab, lab)
    require_readable(lab, tmp_path)
    unit = directives(rendered(lab, "cell")["systemd/gemelo-rm1-stepper_gateway.service"])
    wanted = """NoNewPrivileges=yes User=gemelo ProtectSystem=strict CapabilityBoundingSet= Type=notify WatchdogSec=5
        Restart=always MemoryMax=512M TasksMax=256 LimitNOFILE=4096 LimitCORE=0 UMask=0077 PrivateDevices=yes
        LimitRTPRIO=1"""
    for directive in wanted.split():
        assert tuple(directive.split("=", 1)) in [(key, value) for _, key, value in unit]
    files = rendered(lab, "brain")
    assert files["systemd/gemelo.target"].count("gemelo-rm1-planner.service") == 1
    config = tmp_path / "router.json5"
    config.write_text(files["router.json5"])
    read = zenoh.Config.from_file(str(config))
    assert json.loads(read.get_json("listen/endpoints")) == ["tls/10.0.0.12:7447"]
    assert json.loads(read.get_json("access_control"))["default_permission"] == "deny"


def test_only_what_a_stop_or_a_heartbeat_goes_through_may_take_a_real_time_priority(tmp_path):
    """And it does so: the unit allows what the program asks for, and no other program asks."""
    lab = site(tmp_path)
    entries = tomllib.loads((project_root() / "pyproject.toml").read_text())["project"]["scripts"]
    for host in lab.hosts:
        files = rendered(lab, host)
        for process in processes(lab, host):
            unit = directives(files[f"systemd/{process.unit}.service"])
            module = project_root() / f"{entries[process.program].partition(':')[0].replace('.', '/')}.py"
            asks = "raise_priority()" in module.read_text()
            assert values(unit, "LimitRTPRIO") == (["1"] if asks else []), process
            assert values(unit, "RestrictRealtime") == ([] if asks else ["yes"]), process


def is_of_a_process(name: str) -> bool:
    """What is loaded once at boot is no process: nothing of it could end, or stand still."""
    return name.endswith(".service") and not name.endswith(UNIT_NAME)


def test_a_service_is_started_again_however_often_and_nobody_waits_until_all_are_ready(tmp_path):
    files = rendered(site(tmp_path), "cell")
    for name, text in files.items():
        if is_of_a_process(name):
            assert ("Unit", "StartLimitIntervalSec", "0") in directives(text)
    # Else a target comes after all that it wants, and neither a boot nor `systemctl enable --now` ends before it.
    assert ("Unit", "DefaultDependencies", "no") in directives(files["systemd/gemelo.target"])


def test_a_start_may_last_as_long_as_it_is_said_to_go_on_and_no_longer(tmp_path):
    lab = site(tmp_path)
    for host in lab.hosts:
        for name, text in rendered(lab, host).items():
            if name.endswith(".service"):
                unit = directives(text)
                assert int(*values(unit, "TimeoutStartSec")) > 0  # `infinity` would wait for one that is frozen too
                assert values(unit, "WatchdogSec") == ([str(GOES_ON)] if is_of_a_process(name) else [])


def test_only_a_gateway_on_a_serial_line_sees_devices_also_those_plugged_in_later(tmp_path):
    lab = site(tmp_path, "[robots.rm1]", '[robots.rm1]\nwire = "serial"')
    files = rendered(lab, "cell")
    gateway = directives(files["systemd/gemelo-rm1-stepper_gateway.service"])
    assert values(gateway, "SupplementaryGroups") == ["dialout"]
    assert values(gateway, "DeviceAllow") == ["char-* rw"]  # by its path: only if it is there at the start
    assert values(gateway, "DevicePolicy") == ["closed"]
    assert values(directives(files["systemd/gemelo-broker.service"]), "PrivateDevices") == ["yes"]


def test_a_camera_runs_on_a_host_of_its_own_and_sees_its_device(tmp_path):
    eyes = 'rm1 = ["panel", "camera", "detector"]'
    file = changed(tmp_path, 'rm1 = ["panel"]', eyes)
    file.write_text(file.read_text().replace("[robots.rm1]", '[robots.rm1]\ncell = "urdf/rm1/cell.toml"'))
    files = rendered(load_site(file, project_root()), "desk")
    (tmp_path / "rm1.toml").write_text(files["rm1.toml"])
    assert load_deployment(tmp_path / "rm1.toml", {}).cell == str(project_root() / "urdf/rm1/cell.toml")
    camera = directives(files["systemd/gemelo-rm1-camera.service"])
    assert values(camera, "DeviceAllow") == ["char-* rw"]
    assert values(camera, "SupplementaryGroups") == ["video"]
    assert values(directives(files["systemd/gemelo-rm1-detector.service"]), "PrivateDevices") == ["yes"]


def test_no_rendered_file_of_a_host_names_the_authoritys_key(tmp_path):
    lab = site(tmp_path)
    for host in lab.hosts:
        assert not any("ca.key" in text for text in rendered(lab, host).values())


def test_what_has_left_a_site_leaves_the_hosts_folders_and_what_a_person_put_there_stays(tmp_path):
    folder = tmp_path / "desk"
    parol6 = '[robots.parol6]\nfolder = "urdf/parol6"\npanel_port = 8089\n'
    every = 'parol6 = ["stepper_gateway", "virtual_esp32", "state_publisher", "panel"]'
    file = changed(tmp_path, "[hosts.cell]", f"{parol6}[hosts.cell]")
    text = file.read_text().replace('rm1 = ["panel"]', f'rm1 = ["panel"]\n{every}')
    file.write_text(text.replace('host = "brain"', 'host = "desk"').replace('host = "cell"', 'host = "desk"'))
    write(load_site(file, project_root()), "desk", folder)
    assert (folder / "parol6.toml").exists()
    own = {"notes.toml": "# my own\n", "keys/ca.pem": ""}
    for name, content in own.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(content)
    lab = site(tmp_path)
    write(lab, "desk", folder)
    left = {str(each.relative_to(folder)) for each in folder.rglob("*") if each.is_file()}
    assert left == rendered(lab, "desk").keys() | own.keys()
