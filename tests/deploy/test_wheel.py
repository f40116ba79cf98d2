"""The wheel of the project: one name at its top, and what a user imports in it."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from gemelo.libraries.runtime.deployment import project_root

pytestmark = pytest.mark.full
BUILD = "import sys; from setuptools import build_meta; print(build_meta.build_wheel(sys.argv[1]))"


def test_a_wheel_has_one_name_at_its_top(tmp_path: Path) -> None:
    source = tmp_path / "source"
    subprocess.run(["git", "clone", "--quiet", project_root(), source], check=True)
    done = subprocess.run(
        [sys.executable, "-c", BUILD, str(tmp_path)],
        cwd=source,
        capture_output=True,
        text=True,
        timeout=300,
        check=True,
    )
    with zipfile.ZipFile(tmp_path / done.stdout.splitlines()[-1]) as wheel:
        names = set(wheel.namelist())
        metadata = wheel.read(next(name for name in names if name.endswith(".dist-info/METADATA"))).decode()
    needed = [line.partition(": ")[2] for line in metadata.splitlines() if line.startswith("Requires-Dist: ")]
    assert {each.partition("<")[0].partition(">")[0] for each in needed if "extra ==" not in each} == {
        "eclipse-zenoh",
        "msgspec",
    }
    assert {name.partition("/")[0] for name in names if ".dist-info/" not in name} == {"gemelo"}
    rooms = ("api/arm", "schemas/topics", "services/planner/main", "libraries/runtime/node", "tools/cli/main")
    languages = (f"gemelo/schemas/reasons/languages/{language}/gemelo.mo" for language in ("en", "es"))
    assert {*(f"gemelo/{room}.py" for room in rooms), "gemelo/py.typed", *languages} <= names
    left = ("gemelo/tools/bench", "gemelo/tools/chaos", "gemelo/tools/demo", "gemelo/firmware/tests")
    assert not [name for name in names if name.startswith(left)]
