"""The keys of a site: of mode 600, below out/ alone, no more of them on a host than it shows, and renewed in time."""

from __future__ import annotations

import time

import pytest

from gemelo.libraries.credentials.authority import Authority
from gemelo.libraries.credentials.common_name import common_name
from gemelo.libraries.credentials.expiry import expiry
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.roles import ROLE_OF_NODE, ROLES
from gemelo.tools.hosts.checks import load_site
from gemelo.tools.hosts.keys import authority_in, make_keys
from tests.hosts.sites import EXAMPLE, site
from tests.openssl import openssl

DAY = 86_400.0


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    lab = site(folder)
    make_keys(lab, folder / "out", project_root())
    return lab, folder / "out"


@pytest.mark.parametrize("address", ["fd00::12", "FD00:0::12", "Brain.Lab.local", "xn--ncleo-0ra", "fe80::1"])
def test_every_address_that_a_site_may_have_stands_in_the_routers_certificate(tmp_path, address):
    lab = site(tmp_path, '"10.0.0.12"', f'"{address}"')
    make_keys(lab, tmp_path / "out", project_root())
    said = openssl("x509", "-in", str(tmp_path / "out/brain/keys/router.pem"), "-noout", "-checkip" if ":" in address
                   else "-checkhost", address)  # fmt: skip
    assert "does match certificate" in said


def names(folder) -> set[str]:
    return {file.name for file in folder.iterdir()}


def test_a_host_has_the_keys_of_what_runs_there_and_no_others(made):
    _, out = made
    assert names(out / "cell/keys") == {
        "ca.pem",
        "gateway.pem",
        "gateway.key",
        "state_publisher.pem",
        "state_publisher.key",
    }
    assert names(out / "brain/keys") == {
        "ca.pem", "router.pem", "router.key", "planner.pem", "planner.key", "logger.pem", "logger.key",
    }  # fmt: skip
    assert not (out / "brain/broker").exists()
    assert not (out / "desk/broker").exists()
    assert [file.parent.name for file in out.rglob("ca.key")] == ["authority"]


def test_keys_and_passwords_are_their_owners_alone_and_the_whole_folder_is(made):
    _, out = made
    secrets = [*out.rglob("*.key"), *out.rglob("*.password")]
    assert len(secrets) >= 10
    assert {file.stat().st_mode & 0o777 for file in secrets} == {0o600}
    assert out.stat().st_mode & 0o777 == 0o700


def test_a_certificates_name_is_the_role_a_persons_with_the_host_and_its_unit_the_host(made):
    _, out = made
    for file in out.glob("*/keys/*.pem"):
        if file.stem in {role.name for role in ROLES}:
            said = openssl("x509", "-in", str(file), "-noout", "-subject").replace(" ", "")
            host, is_service = file.parent.parent.name, file.stem in ROLE_OF_NODE.values()
            name = file.stem if is_service else f"{file.stem}.{host}"
            assert said.strip() == f"subject=OU={host},CN={name}"
            assert common_name(file) == name


def test_a_certificate_of_another_name_is_made_anew(tmp_path):
    lab = site(tmp_path)
    make_keys(lab, tmp_path / "out", project_root())
    authority = authority_in(tmp_path / "out")
    files = next((tmp_path / "out").glob("*/keys/operator.pem")), next((tmp_path / "out").glob("*/keys/operator.key"))
    authority.sign_client("operator", *files)
    renewed = {(each.host, each.name) for each in make_keys(lab, tmp_path / "out", project_root()) if each.is_new}
    assert renewed == {(files[0].parent.parent.name, "operator")}


def test_what_is_sound_is_kept_and_what_ends_soon_or_has_another_address_is_renewed(tmp_path):
    lab = site(tmp_path)
    first = {(each.host, each.name): each for each in make_keys(lab, tmp_path / "out", project_root())}
    assert all(each.is_new for each in first.values())
    assert all(364 * DAY < each.expires - time.time() < 366 * DAY for each in first.values())
    key = (tmp_path / "out/brain/keys/planner.key").read_bytes()
    again = {(each.host, each.name): each for each in make_keys(lab, tmp_path / "out", project_root())}
    assert not any(each.is_new for each in again.values())
    assert (tmp_path / "out/brain/keys/planner.key").read_bytes() == key

    moved = site(tmp_path, '"10.0.0.12"', '"10.0.0.99"')
    renewed = {(each.host, each.name) for each in make_keys(moved, tmp_path / "out", project_root()) if each.is_new}
    assert renewed == {("brain", "router")}

    authority = Authority(tmp_path / "out/authority/ca.pem", tmp_path / "out/authority/ca.key")
    old = tmp_path / "out/brain/keys"
    authority.sign_client("planner", old / "planner.pem", old / "planner.key", days=29)
    renewed = {(each.host, each.name) for each in make_keys(moved, tmp_path / "out", project_root()) if each.is_new}
    assert renewed == {("brain", "planner")}
    assert expiry(old / "planner.pem") - time.time() > 300 * DAY

    elsewhere = site(tmp_path, '"10.0.0.11"', '"10.0.0.98"')
    renewed = {(each.host, each.name) for each in make_keys(elsewhere, tmp_path / "out", project_root()) if each.is_new}
    assert renewed == {("cell", "broker"), ("brain", "router")}  # whose address is again the first one


def test_a_new_authority_renews_everything_and_a_role_that_left_is_taken_away(tmp_path):
    lab, out = site(tmp_path), tmp_path / "out"
    make_keys(lab, out, project_root())
    for file in (out / "authority").iterdir():
        file.unlink()
    assert all(each.is_new for each in make_keys(lab, out, project_root()))
    without = site(tmp_path, 'roles = ["operator", "viewer"]', 'roles = ["viewer"]')
    make_keys(without, out, project_root())
    assert names(out / "desk/keys") == {"ca.pem", "viewer.pem", "viewer.key", "panel.pem", "panel.key"}


def test_the_device_of_a_robot_that_left_has_no_user_and_no_rights_any_more(tmp_path):
    lab, out = site(tmp_path), tmp_path / "out"
    make_keys(lab, out, project_root())
    broker = out / "cell/broker"
    assert "user rm1\n" in (broker / "acl").read_text()
    (tmp_path / "lab.toml").write_text(EXAMPLE.read_text(encoding="utf-8").replace("rm1", "parol6"), encoding="utf-8")
    make_keys(load_site(tmp_path / "lab.toml", project_root()), out, project_root())
    assert (broker / "users").read_text().count("\n") == 2
    assert {each.stem for each in broker.glob("*.password")} == {"gateway", "parol6"}
    assert "user rm1\n" not in (broker / "acl").read_text()
