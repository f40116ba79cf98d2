"""The image of a host holds no keys, and its user is the one whom the mounted keys belong to."""

from __future__ import annotations

import json

from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.hosts.layout import extras
from gemelo.tools.hosts.render import rendered
from tests.hosts.sites import site


def patterns(name: str) -> set[str]:
    lines = (project_root() / name).read_text(encoding="utf-8").splitlines()
    return {line.strip("/").removeprefix("**/") for line in lines if line and not line.startswith("#")}


def test_what_the_repository_leaves_out_no_image_has_either():
    assert patterns(".gitignore") | {".git"} == patterns(".dockerignore")
    assert "out" in patterns(".dockerignore")  # where `gemelo deploy keys` writes the authority


def test_an_image_has_the_user_of_the_services_and_installs_what_its_host_runs(tmp_path):
    lab = site(tmp_path)
    for host in lab.hosts:
        lines = rendered(lab, host)["Containerfile"].splitlines()
        assert f'    && EXTRAS="{" ".join(extras(lab, host))}" SUPERVISOR=none deploy/bootstrap \\' in lines
        # Its folders are readable for this user alone, and root without capabilities is nobody special.
        assert lines[-1] == f"USER {lab.user}"
        assert not any("user" in service for service in services(lab, host).values())


def test_a_container_has_the_limits_of_its_unit(tmp_path):
    lab = site(tmp_path)
    for host in lab.hosts:
        files = rendered(lab, host)
        for name, made in services(lab, host).items():
            unit = dict(line.split("=", 1) for line in files[f"systemd/{name}.service"].splitlines() if "=" in line)
            assert made["mem_limit"] == unit["MemoryMax"].lower()
            assert made["pids_limit"] == int(unit["TasksMax"])
            assert made["ulimits"] == {"nofile": int(unit["LimitNOFILE"]), "core": int(unit["LimitCORE"])}


def test_a_serial_line_is_open_to_a_gateway_that_is_not_root(tmp_path):
    made = services(site(tmp_path, "[robots.rm1]", '[robots.rm1]\nwire = "serial"'), "cell")
    assert made["gemelo-rm1-stepper_gateway"]["group_add"] == ["dialout"]
    assert made["gemelo-rm1-stepper_gateway"]["devices"] == ["/dev/ttyUSB0:/dev/ttyUSB0"]
    assert [name for name, each in made.items() if "devices" in each] == ["gemelo-rm1-stepper_gateway"]


def services(lab, host):
    return json.loads(rendered(lab, host)["compose.yaml"])["services"]
