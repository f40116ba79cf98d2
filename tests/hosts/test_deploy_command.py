"""`gemelo deploy` as a person types it; ssh and rsync are recorded by programs of their names."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path

import pytest

from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.cli.main import run
from gemelo.tools.hosts.install import commands
from tests.hosts.sites import EXAMPLE, changed, site

RECORDER = """#!{python}
import json, sys
with open({log!r}, "a") as log:
    log.write(json.dumps(sys.argv) + "\\n")
sys.exit({code})
"""


@pytest.fixture
def out(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("GEMELO_PATHS_OUT", str(tmp_path / "out"))
    return tmp_path / "out/deploy/example"


def recording(folder: Path, monkeypatch, **codes: int) -> Path:
    """A log of what ssh and rsync were called with; they end with `codes`."""
    log = folder / "log"
    for name in ("ssh", "rsync"):
        program = folder / name
        program.write_text(RECORDER.format(python=sys.executable, log=str(log), code=codes.get(name, 0)))
        program.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder), prepend=":")
    return log


def gemelo(*words: str) -> int:
    return int(run(words))


def test_check_says_what_runs_where_and_a_mistake_ends_with_its_line(tmp_path, capsys):
    assert gemelo("deploy", "check", "example") == 0
    said = capsys.readouterr().out
    assert "router, rm1-planner, rm1-logger" in said
    assert 'EXTRAS="planner record"' in said  # what this host is to install
    file = tmp_path / "lab.toml"
    file.write_text(EXAMPLE.read_text().replace('"planner", "logger"', '"planer"'))
    assert gemelo("deploy", "check", str(file)) == 1
    assert f'{file}, line 22: "planer" is not a service of a robot' in capsys.readouterr().err
    assert gemelo("deploy", "check", "nowhere") == 1
    assert "there is no such file" in capsys.readouterr().err


def test_render_and_keys_write_below_out_and_install_shows_before_it_does(out, tmp_path, capsys, monkeypatch):
    log = recording(tmp_path, monkeypatch)
    assert gemelo("deploy", "install", "example", "brain", "--dry-run") == 1
    assert "`gemelo deploy render example` makes it" in capsys.readouterr().err
    assert gemelo("deploy", "render", "example", "brain") == 0
    assert gemelo("deploy", "install", "example", "brain", "--dry-run") == 1
    assert "`gemelo deploy keys example` makes it" in capsys.readouterr().err
    assert gemelo("deploy", "keys", "example") == 0
    assert "valid until" in capsys.readouterr().out
    assert {each.name for each in out.iterdir()} == {"authority", "brain", "cell", "desk"}

    assert gemelo("deploy", "install", "example", "brain", "--dry-run") == 0
    shown = [shlex.split(line) for line in capsys.readouterr().out.splitlines()]
    assert not log.exists()
    assert gemelo("deploy", "install", "example", "brain") == 0
    done = [json.loads(line) for line in log.read_text().splitlines()]
    assert [[Path(each[0]).name, *each[1:]] for each in done] == shown
    assert not any("authority" in word for each in done for word in each)


def test_what_cannot_be_written_is_named(out, capsys):
    out.parent.mkdir(parents=True)
    out.touch()
    assert gemelo("deploy", "render", "example") == 1
    assert capsys.readouterr().err == f"gemelo: {out}/cell cannot be written: Not a directory\n"
    assert gemelo("deploy", "keys", "example") == 1
    assert capsys.readouterr().err == f"gemelo: {out} cannot be written: File exists\n"


def test_an_authority_without_its_key_is_not_replaced_and_a_broken_one_harms_no_certificate(out, capsys):
    """Hosts that got a certificate of another authority would no longer be believed by the rest."""
    assert gemelo("deploy", "keys", "example") == 0
    key = out / "authority/ca.key"
    before, kept = all_below(out), key.read_bytes()
    for spoil in (key.unlink, lambda: key.write_text("no key")):
        spoil()
        assert gemelo("deploy", "keys", "example", "--renew-within", "4000") == 1
        assert "authority" in capsys.readouterr().err
        key.write_bytes(kept)
        assert all_below(out) == before
    key.unlink()
    assert gemelo("deploy", "keys", "example") == 1
    assert (
        f"{key} is missing beside ca.pem: bring it back; or delete {key.with_name('ca.pem')}" in capsys.readouterr().err
    )


def all_below(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def test_an_install_stops_at_the_first_command_that_fails(out, tmp_path, capsys, monkeypatch):
    for words in (("render", "example", "brain"), ("keys", "example")):
        assert gemelo("deploy", *words) == 0
    log = recording(tmp_path, monkeypatch, rsync=23)
    assert gemelo("deploy", "install", "example", "brain") == 1
    assert "ended with 23: rsync" in capsys.readouterr().err
    assert len(log.read_text().splitlines()) == 3


def test_files_of_a_site_that_has_changed_since_are_not_installed(out, tmp_path, capsys, monkeypatch):
    """The address of the router's host stands in the files of all the others."""
    log, file = recording(tmp_path, monkeypatch), changed(tmp_path)
    for word in ("render", "keys"):
        assert gemelo("deploy", word, str(file)) == 0
    file.write_text(file.read_text().replace("10.0.0.12", "10.0.0.22"))
    assert gemelo("deploy", "install", str(file), "cell") == 1
    said = f"cell/rm1.toml is not what the site's file says now: `gemelo deploy render {file}`"
    assert said in capsys.readouterr().err
    assert not log.exists()
    assert gemelo("deploy", "render", str(file)) == 0
    assert gemelo("deploy", "install", str(file), "cell") == 0


def test_a_path_with_quotes_stays_one_word_of_the_other_hosts_shell(tmp_path):
    lab = site(tmp_path, "# A lab", "config = \"/etc/a 'b'; reboot\"\n# A lab")
    for name in ("systemd", "keys"):
        (tmp_path / "brain" / name).mkdir(parents=True)
    prepare, look, copy, _ = commands(lab, "brain", tmp_path / "brain")
    assert shlex.split(prepare[2])[-2:] == [lab.config, lab.state]
    assert "reboot" not in shlex.split(prepare[2])
    assert "/opt/gemelo/.venv/bin/gemelo" in shlex.split(look[2])
    assert copy[-1] == f"root@10.0.0.12:{lab.config}/"
    assert project_root() not in Path(copy[-1]).parents
