"""Mistakes in a site's file are reported before anything is written, each with its line."""

from __future__ import annotations

import pytest

from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.hosts.checks import load_site
from gemelo.tools.hosts.layout import processes, roles
from gemelo.tools.hosts.site_file import SiteError
from tests.hosts.sites import EXAMPLE, changed, site
from tests.table import table

SERVICES = 'rm1 = ["stepper_gateway", "virtual_esp32", "state_publisher"]'
PLANS = 'rm1 = ["planner", "logger"]'


def line_of(text: str) -> int:
    return EXAMPLE.read_text(encoding="utf-8").split(text)[0].count("\n") + 1


def problem(folder, old: str, new: str) -> str:
    with pytest.raises(SiteError) as caught:
        site(folder, old, new)
    return str(caught.value)


@table(
    ("old", "new", "said"),
    [
        ('"planner", "logger"', '"planer", "logger"', '"planer" is not a service of a robot: did you mean "planner"?'),
        ('"planner", "logger"', '"router"', '"router" is not a service of a robot: [router] says where it runs'),
        (PLANS, 'rm1 = ["stepper_gateway"]', "rm1 has two of stepper_gateway, on cell and on brain"),
        ('rm1 = ["panel"]', 'rm2 = ["panel"]', 'there is no robot "rm2" in [robots]: did you mean "rm1"?'),
        (
            'roles = ["operator"',
            'roles = ["operater"',
            '"operater" has no permission that a person or script could use',
        ),
        ('roles = ["operator"', 'roles = ["gateway"', '"gateway" has no permission that a person or script'),
        ('address = "10.0.0.13"', 'address = "10.0.0.12"', "10.0.0.12 is the address of brain too"),
        ('address = "10.0.0.13"', 'address = "a b"', "'a b' is neither a host name nor an IP address"),
        ('address = "10.0.0.13"', 'address = ""', "'' is neither a host name nor an IP address"),
        ('address = "10.0.0.13"', 'address = "0.0.0.0"', "nobody can connect to 0.0.0.0: that is for `listen`"),
        (
            'address = "10.0.0.13"',
            "address = 13",
            'key "hosts.desk.address": must be a text in "...", not a whole number',
        ),
        ('roles = ["operator", "viewer"]', 'roles = "viewer"', 'key "hosts.desk.roles": must be a list, not a text'),
        ('address = "10.0.0.13"', 'address = "10.0.0.300"', "'10.0.0.300' is neither a host name nor an IP address"),
        ('address = "10.0.0.13"', 'address = "localhost"', "localhost is each host's own: write the address by which"),
        ('address = "10.0.0.13"', 'adress = "10.0.0.13"', 'unknown key "hosts.desk.adress": did you mean'),
        (
            'host = "brain"',
            'host = "brian"',
            'the router is on "brian", which is not in [hosts]: did you mean "brain"?',
        ),
        ('folder = "urdf/rm1"', 'folder = "urdf/rm2"', "rm1: "),
        ('folder = "urdf/rm1"', 'folder = "urdf/parol6"', 'the robot of urdf/parol6 is named "parol6"'),
        ('folder = "urdf/rm1"', 'folder = "/rm1"', 'folder = "/rm1" must be below the project'),
        ('"planner", "logger"', '"planner", "camera"', 'camera of rm1 needs a cell: write cell = "urdf/rm1/cell.toml"'),
        (
            'folder = "urdf/rm1"',
            'cell = "/cell.toml"\nfolder = "urdf/rm1"',
            'cell = "/cell.toml" must be below the project',
        ),
        ('folder = "urdf/rm1"', 'cell = "urdf/rm1/robot.toml"\nfolder = "urdf/rm1"', "rm1: "),
        ('folder = "urdf/rm1"', 'cell = "urdf/none.toml"\nfolder = "urdf/rm1"', "rm1: "),
        ('device = "virtual"', 'device = "board"', "so virtual_esp32 has nothing to do on cell"),
        ('device = "virtual"', 'device = "real"', "key \"robots.rm1.device\": 'real' is not one of virtual, board"),
    ],
)
def test_each_mistake_is_named_with_its_line(tmp_path, old, new, said):
    text = problem(tmp_path, old, new)
    assert said in text
    at = line_of(old) if said != "so virtual_esp32 has nothing to do on cell" else line_of("[robots.rm1]")
    assert any(f"lab.toml, line {at}: " in line for line in text.splitlines() if said in line), text


def test_no_host_is_called_like_the_folder_of_the_authoritys_key_which_would_go_to_it(tmp_path):
    file = changed(tmp_path)
    file.write_text(file.read_text().replace("[hosts.desk", "[hosts.authority"))
    with pytest.raises(SiteError, match='no host can have the name "authority"'):
        load_site(file, project_root())


def test_a_robot_without_what_makes_its_state_is_refused(tmp_path):
    assert "rm1 has no stepper_gateway on any host" in problem(tmp_path, SERVICES, 'rm1 = ["virtual_esp32"]')
    assert "rm1 has no virtual_esp32 on any host" in problem(
        tmp_path, SERVICES, 'rm1 = ["stepper_gateway", "state_publisher"]'
    )


def test_a_virtual_device_on_a_serial_line_is_on_the_host_of_its_gateway(tmp_path):
    file = changed(tmp_path, 'device = "virtual"', 'wire = "serial"')
    load_site(file, project_root())
    file.write_text(file.read_text().replace('"virtual_esp32", ', "").replace('"logger"', '"logger", "virtual_esp32"'))
    with pytest.raises(SiteError, match="line 12: a virtual device on a serial line is on the host of its gateway"):
        load_site(file, project_root())


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('host = "cell"', 'host = "cell"\nport = 883', "line 9: 883 is root's, which the services are not"),
        ('host = "cell"', 'host = "cell"\nport = 70000', "line 9: 70000 is no port: 1024 to 65535"),
        (PLANS, 'rm1 = "planner"', 'line 22: key "hosts.brain.services.rm1": must be a list, not a text'),
        (PLANS, 'rm1 = [\n"planner",\n7]', 'line 24: key "hosts.brain.services.rm1": what stands in it must be a text'),
        (
            PLANS,
            'rm1 = ["plan\\ner"]',
            "line 22: key \"hosts.brain.services.rm1\": what stands in it 'plan\\ner' holds",
        ),
        ("# A lab", "certificate_days = 40000\n# A lab", "line 1: 40000 days: a certificate has 1 to 3650"),
        (
            "# A lab",
            'state = "/etc/gemelo"\n# A lab',
            'services may write below state = "/etc/gemelo", so config cannot',
        ),
        ("# A lab", 'project = "/var/lib/gemelo/x"\n# A lab', "so project cannot be there"),
        ('"10.0.0.12"', '"fe80::1%eth0"', "line 20: fe80::1%eth0 has a zone, which no certificate can name"),
        ('"10.0.0.11"', '"10.0.0.11"\nlisten = "fe80::1%a"', "line 16: fe80::1%a has a zone, which no certificate"),
        ('"10.0.0.12"', '"10.0.0.12"\nlisten = "::1"', "line 21: ::1 is brain's own: no other host reaches"),
        ('device = "virtual"', 'wire = "serial"\nserial = "ttyUSB0"', 'as "/dev/ttyUSB0"'),
    ],
)
def test_what_could_never_work_is_refused_with_its_line(tmp_path, old, new, said):
    assert said in problem(tmp_path, old, new)


def test_one_host_may_be_reached_over_loopback_and_two_names_that_differ_in_case_are_one(tmp_path):
    file = tmp_path / "lab.toml"
    every = '["stepper_gateway", "virtual_esp32", "state_publisher"]'
    file.write_text(f"""router.host = "one"
broker.host = "one"
robots.rm1.folder = "urdf/rm1"
hosts.one = {{ address = "localhost", services.rm1 = {every} }}
""")
    load_site(file, project_root())
    file = changed(tmp_path, '"10.0.0.12"', '"Desk.lab"')
    file.write_text(file.read_text().replace('"10.0.0.13"', '"desk.LAB"'))
    with pytest.raises(SiteError, match=r"line 25: desk\.LAB is the address of brain too"):
        load_site(file, project_root())


def test_a_file_of_any_editor_is_read_or_said_to_be_in_another_encoding(tmp_path):
    file = changed(tmp_path, "# A lab", "# Laboratorio ñ")
    text = file.read_text(encoding="utf-8")
    file.write_text(text, encoding="utf-8-sig")
    load_site(file, project_root())
    file.write_text(text, encoding="latin-1")
    with pytest.raises(SiteError, match="line 1: the byte 0xf1 is not UTF-8: save it as UTF-8"):
        load_site(file, project_root())


def test_two_that_would_listen_on_one_port_are_named(tmp_path):
    text = problem(tmp_path, 'host = "cell"', 'host = "brain"\nport = 7447')
    assert "port 7447 of brain is wanted by the router and by the broker" in text
    parol6 = '[robots.parol6]\nfolder = "urdf/parol6"\n[hosts.cell]'
    file = changed(tmp_path, "[hosts.cell]", parol6)
    every = 'parol6 = ["stepper_gateway", "virtual_esp32", "state_publisher", "panel"]'
    file.write_text(file.read_text().replace('rm1 = ["panel"]', f'rm1 = ["panel"]\n{every}'))
    with pytest.raises(SiteError, match=r"port 8088 of desk is wanted by panel of rm1 .* and by panel of parol6"):
        load_site(file, project_root())
    file.write_text(file.read_text().replace('"urdf/parol6"', '"urdf/parol6"\npanel_port = 8089'))
    assert set(load_site(file, project_root()).robots) == {"rm1", "parol6"}


def test_a_viewer_is_on_the_host_of_its_visualizer(tmp_path):
    text = problem(tmp_path, PLANS, 'rm1 = ["planner", "visualizer"]')
    assert "the visualizer of rm1 shows in a viewer on its own host" in text


def test_all_mistakes_are_said_at_once_in_the_order_of_the_lines(tmp_path):
    file = changed(tmp_path, '"planner", "logger"', '"planer"')
    file.write_text(file.read_text().replace('roles = ["operator"', 'roles = ["nobody"').replace('"10.0.0.11"', '"-"'))
    with pytest.raises(SiteError) as caught:
        load_site(file, project_root())
    lines = [int(each.split("line ")[1].split(":")[0]) for each in str(caught.value).splitlines()]
    assert len(lines) == 3
    assert lines == sorted(lines)


@table("key", ["project", "config", "state"])
@table("path", ["relative", "/", "/a/../b", "/a$HOME", "/a%h", "/a\\\\", "/a\\n/b", "/a "])
def test_a_path_that_means_more_than_a_path_is_refused(tmp_path, key, path):
    assert "line 1: " in problem(tmp_path, "# A lab", f'{key} = "{path}"\n# A lab')


@table("user", ["root", "", "a b", "x;reboot", "Ünal"])
def test_a_user_that_cannot_be_or_should_not_be_is_refused(tmp_path, user):
    assert "line 1: " in problem(tmp_path, "# A lab", f'user = "{user}"\n# A lab')


def test_a_host_needs_certificates_for_its_services_and_its_people_alone(tmp_path):
    lab = site(tmp_path)
    assert roles(lab, "cell") == ("gateway", "state_publisher")
    assert roles(lab, "brain") == ("logger", "planner")
    assert roles(lab, "desk") == ("operator", "panel", "viewer")
    assert [each.unit for each in processes(lab, "brain")] == [
        "gemelo-router", "gemelo-rm1-planner", "gemelo-rm1-logger",
    ]  # fmt: skip
