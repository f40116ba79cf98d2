"""A command: one file with what it does, and one row of the table of commands."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.additions import ROOT, added, row_added, run_in

HEIGHT = '''"""`gemelo height`: how high the tool is."""

from __future__ import annotations

from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.common.session import connect_arm, load_robot
from gemelo.tools.cli.parser import Options, Parser


def add_options(parser: Parser) -> None:
    """Adds the unit."""
    parser.add_argument("--mm", action="store_true", help="in millimetres instead of metres")


def run(options: Options) -> ExitCode:
    """Prints one line."""
    with connect_arm(load_robot()) as arm:
        height = arm.pose().position[2]
    print(f"{1000.0 * height:.1f} mm" if options.mm else f"{height:.4f} m")
    return ExitCode.OK
'''
ROW = """    Command(("height",), "how high the tool is", "watch.height:run", "watch.height:add_options","""
EXAMPLE = """            "gemelo height --mm"),"""
GEMELO = ("-m", "gemelo.tools.cli.main")


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """This one, with the command."""
    table = "tools/cli/commands.py"
    files = {"tools/cli/watch/height.py": HEIGHT, **row_added(table, after="COMMANDS = (", row=f"{ROW}\n{EXAMPLE}")}
    return added(tmp_path_factory.mktemp("project"), files)


def test_a_new_command_runs_and_stands_in_the_help_and_in_the_completion(project: Path) -> None:
    done = run_in(project, *GEMELO, "--simulate=home", "height", "--mm")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "17.7 mm\n"
    assert "how high the tool is" in run_in(project, *GEMELO, "--help").stdout
    assert "--mm" in run_in(project, *GEMELO, "height", "--help").stdout
    assert 'did you mean "height"?' in run_in(project, *GEMELO, "heigt").stderr
    completion = run_in(project, *GEMELO, "completion").stdout
    assert "height" in completion


def test_a_row_is_all_of_the_table_that_it_takes(project: Path) -> None:
    before, after = ((each / "tools/cli/commands.py").read_text().splitlines() for each in (ROOT, project))
    assert [line for line in after if line not in before] == [ROW, EXAMPLE]
