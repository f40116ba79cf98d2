"""`deploy/run_tests` runs a few failures once more alone, and hides none."""

from __future__ import annotations

import shutil
import subprocess

import pytest

PYTEST = """#!/bin/sh
# Fails with FAILURES names and CODE at first, and with AGAIN when only what has failed is run.
case $* in
    *--last-failed*) echo "alone: $*"; exit $AGAIN ;;
esac
for number in $(seq 1 $FAILURES); do echo "FAILED tests/test_$number.py::test - assert"; done
exit $CODE
"""


@pytest.fixture
def run(tmp_path, pytestconfig):
    for folder in ("deploy", ".venv/bin"):
        (tmp_path / folder).mkdir(parents=True)
    shutil.copy(pytestconfig.rootpath / "deploy/run_tests", tmp_path / "deploy")
    program = tmp_path / ".venv/bin/pytest"
    program.write_text(PYTEST)
    program.chmod(0o755)

    def run_with(failures: int, code: int, again: int) -> subprocess.CompletedProcess[str]:
        environment = {"PATH": "/usr/bin:/bin", "FAILURES": str(failures), "CODE": str(code), "AGAIN": str(again)}
        command = [str(tmp_path / "deploy/run_tests"), "loadfile", "tests/a", "tests/b"]
        return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=20.0)

    return run_with


@pytest.mark.parametrize(
    ("failures", "code", "again", "expected", "is_repeated"),
    [
        pytest.param(0, 0, 1, 0, False, id="all pass"),
        pytest.param(2, 1, 0, 0, True, id="what failed beside others passes alone"),
        pytest.param(2, 1, 1, 1, True, id="what fails alone too has failed"),
        pytest.param(6, 1, 0, 1, False, id="many failures are no want of time"),
        pytest.param(0, 2, 0, 2, False, id="an interrupt or a file that cannot be read is no failure of a test"),
    ],
)
def test_a_few_failures_are_run_once_more_alone(run, failures, code, again, expected, is_repeated):
    done = run(failures, code, again)
    assert done.returncode == expected, done.stderr
    assert ("alone: " in done.stdout) is is_repeated
    assert done.stdout.count("FAILED ") == failures
    if is_repeated:
        assert done.stdout.splitlines()[-1].endswith("--last-failed-no-failures none tests/a tests/b")


def test_files_begin_in_the_order_in_which_they_are_given(tmp_path, pytestconfig):
    (tmp_path / "deploy").mkdir()
    shutil.copy(pytestconfig.rootpath / "deploy/run_tests", tmp_path / "deploy")
    (tmp_path / ".venv").symlink_to(pytestconfig.rootpath / ".venv")
    note = "open('order', 'a').write(__name__[-3:] + ' ')"
    (tmp_path / "test_one.py").write_text(f"def test_long(): {note}\n")
    (tmp_path / "test_two.py").write_text("".join(f"def test_short_{number}(): {note}\n" for number in range(3)))
    program = tmp_path / "nproc"
    program.write_text("#!/bin/sh\necho 1\n")  # one core, one worker
    program.chmod(0o755)
    environment = {"PATH": f"{tmp_path}:/usr/bin:/bin"}
    command = [str(tmp_path / "deploy/run_tests"), "loadfile", "test_one.py", "test_two.py"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60.0)
    assert done.returncode == 0, done.stdout
    assert (tmp_path / "order").read_text() == "one two two two "


def test_every_file_of_tests_is_run_by_make_test_once(pytestconfig):
    root = pytestconfig.rootpath
    recipe = subprocess.run(["make", "-n", "test"], cwd=root, capture_output=True, text=True, timeout=20.0, check=True)
    given = [line.split()[2:] for line in recipe.stdout.splitlines() if line.startswith("deploy/run_tests ")]
    assert len(given) == 4
    paths = [root / path for stage in given for path in stage]
    files = [file for path in paths for file in (path.rglob("test_*.py") if path.is_dir() else [path])]
    assert sorted(files) == sorted((root / "tests").rglob("test_*.py"))
