"""The ten lines of docs/several_hosts.md, and of its Spanish page, are commands and files that there are."""

from __future__ import annotations

import re
import shlex

from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.cli.main import parse
from gemelo.tools.hosts.layout import extras
from tests.hosts.sites import site

SECTION = re.compile(r"^## (?:In ten lines|En diez líneas)\n.*?```\n(.*?)```", re.DOTALL | re.MULTILINE)
PAGES = ("docs/several_hosts.md", "docs/es/varios_equipos.md")


def lines(page: str = PAGES[0]) -> list[list[str]]:
    """The words of each line, without its comment."""
    found = SECTION.search((project_root() / page).read_text(encoding="utf-8"))
    assert found is not None
    return [shlex.split(line, comments=True) for line in found[1].splitlines()]


def test_they_are_ten_from_a_sites_file_to_a_move():
    words = lines()
    assert len(words) == 10
    assert (project_root() / words[0][1]).is_file()
    assert words[-1][:2] == ["gemelo", "move"]


def test_they_are_the_same_in_spanish():
    english, spanish = map(lines, PAGES)
    assert english == spanish


def test_each_command_of_gemelo_is_one_that_it_takes_for_the_hosts_of_the_example(tmp_path):
    lab = site(tmp_path)
    commands = [words for words in lines() if words[0] == "gemelo"]
    (loop,) = (words for words in lines() if words[0] == "for")
    begin, end = loop.index("do"), loop.index("done")
    assert [each.rstrip(";") for each in loop[3:begin]] == list(lab.hosts)
    commands.append([each.rstrip(";") for each in loop[begin + 1 : end]])
    for words in commands:
        options = parse(words[1:])
        if words[1] == "deploy":
            assert options.site == "lab"
            assert getattr(options, "host", "cell") in (*lab.hosts, "$host")
    assert len(commands) == 6


def test_its_places_and_its_user_are_those_of_a_site_that_names_none(tmp_path):
    lab = site(tmp_path)
    text = " ".join(" ".join(words) for words in lines())
    assert f"GEMELO_CONFIG={lab.config}/rm1.toml PATH={lab.project}/.venv/bin:" in text
    assert f"sudo -u {lab.user} -s" in text
    assert f"make setup EXTRAS={' '.join(extras(lab, 'brain'))}" in text
