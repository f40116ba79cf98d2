"""A site's mistakes as data: the code and the values of each cause, and its line."""

from __future__ import annotations

from pathlib import Path

import pytest

from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.reasons import Reason, Value, because, remedy, say
from gemelo.tools.cli.hosts.use import standing
from gemelo.tools.hosts.install import commands, run
from gemelo.tools.hosts.site_file import SiteError, read_site
from tests.hosts.sites import EXAMPLE, site
from tests.table import table


def problem(folder: Path, old: str, new: str) -> list[Reason]:
    with pytest.raises(SiteError) as caught:
        site(folder, old, new)
    assert caught.value.reason.code == "site.problems"
    assert {cause.code for cause in caught.value.reason.causes} == {"file.line"}
    return [cause.causes[0] for cause in caught.value.reason.causes]


@table(
    ("old", "new", "code", "values"),
    [
        ('"planner", "logger"', '"planer"', "site.service.unknown", {"service": "planer"}),
        ('"planner", "logger"', '"router"', "site.service.own_table", {"service": "router"}),
        ('rm1 = ["panel"]', 'rm2 = ["panel"]', "site.robot.unknown", {"robot": "rm2"}),
        ('roles = ["operator"', 'roles = ["gateway"', "site.role", {"role": "gateway"}),
        ('address = "10.0.0.13"', 'address = "a b"', "site.host.address", {"address": "'a b'"}),
        ('address = "10.0.0.13"', 'address = "0.0.0.0"', "site.host.unspecified", {"address": "0.0.0.0"}),
        ('address = "10.0.0.13"', 'adress = "10.0.0.13"', "site.key.unknown", {"key": "hosts.desk.adress"}),
        ('folder = "urdf/rm1"', 'folder = "/rm1"', "site.robot.folder", {"folder": "/rm1", "robot": "rm1"}),
        ('host = "brain"', 'host = "brian"', "site.host.unknown", {"service": "router", "host": "brian"}),
    ],
)
def test_a_mistake_has_its_code_and_values(
    tmp_path: Path, old: str, new: str, code: str, values: dict[str, Value]
) -> None:
    found = {each.code: each for each in problem(tmp_path, old, new)}
    assert found[code].values == values
    assert say(found[code], "es") != str(found[code])


def test_a_value_of_another_kind_names_both(tmp_path: Path) -> None:
    kinds = because("site.value.kind", wanted="str", got="int")
    wrong = problem(tmp_path, 'address = "10.0.0.13"', "address = 13")
    assert because("site.key", kinds, key="hosts.desk.address") in wrong


def test_a_hint_is_the_nearest_name(tmp_path: Path) -> None:
    wrong = problem(tmp_path, '"planner", "logger"', '"planer"')
    assert because("site.service.unknown", remedy("did_you_mean", name="planner"), service="planer") in wrong


def test_a_site_without_a_file_names_the_one_to_copy() -> None:
    file = project_root() / "deploy/hosts/nowhere.toml"
    with pytest.raises(SiteError) as none:
        read_site(file)
    assert none.value.reason == because("site.none", file=str(file))


def test_what_was_not_made_is_named_with_what_makes_it(tmp_path: Path) -> None:
    example, _ = read_site(EXAMPLE)
    with pytest.raises(SiteError) as missing:
        commands(example, "cell", tmp_path)
    made_by = {"name": "systemd", "maker": "gemelo deploy render example"}
    assert missing.value.reason == because("site.install.missing", folder=str(tmp_path), **made_by)


def test_a_command_that_fails_or_is_not_there_is_named() -> None:
    with pytest.raises(SiteError) as ended:
        run((("false",),))
    assert ended.value.reason == because("site.install.ended", code=1, command="false")
    with pytest.raises(SiteError) as missing:
        run((("no-such-command",),))
    assert missing.value.reason == because("site.install.command", command="no-such-command")


def test_which_robot_commands_are_for() -> None:
    assert standing(["rm1"], "") == because("cli.use.one", robot="rm1")
    assert standing(["a", "b"], "b") == because("cli.use.chosen", robots="a, b", chosen="b")
    assert standing(["a", "b"], "") == because("cli.use.which", robots="a, b", first="a")
    assert standing([], "a") == because("cli.use.none_but", chosen="a")
