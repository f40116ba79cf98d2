"""Results replace the results of an earlier run only: no option makes a run remove what a person has."""

import subprocess
import sys
from pathlib import Path

import pytest

from gemelo.tools.stack.results import MARK, new_results
from gemelo.tools.stack.stack import StackError

BEGUN = 60.0  # [s] in which a run that does not refuse its folder would have emptied it
COMMANDS = (
    ("gemelo.tools.chaos", "--broker", "embedded", "--minutes", "0.1"),
    ("gemelo.tools.chaos.soak", "--broker", "embedded", "--hours", "0.001"),
    ("gemelo.tools.demo", "--broker", "embedded", "--no-picture"),
)


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
def test_a_folder_with_other_files_is_refused_and_left_as_it_was(command, tmp_path: Path, pytestconfig):
    kept = tmp_path / "demo" / "thesis.txt"
    kept.parent.mkdir()
    kept.write_text("three years")
    done = subprocess.run(
        [sys.executable, "-m", *command, "--out", str(tmp_path)],
        cwd=pytestconfig.rootpath, capture_output=True, text=True, timeout=BEGUN,
    )  # fmt: skip
    assert done.returncode == 1
    assert "holds files that no such run has left there" in done.stderr
    assert kept.read_text() == "three years"


def test_what_an_earlier_run_left_is_removed(tmp_path: Path):
    folder = new_results(tmp_path / "new" / "out")
    (folder / "logs").mkdir()
    (folder / "logs" / "planner.log").write_text("old")
    assert [path.name for path in new_results(folder).iterdir()] == [MARK]
    empty = tmp_path / "empty"
    empty.mkdir()
    assert new_results(empty) == empty


def test_a_file_is_no_folder(tmp_path: Path):
    file = tmp_path / "out"
    file.write_text("mine")
    with pytest.raises(StackError, match="Not a directory"):
        new_results(file)
    assert file.read_text() == "mine"
