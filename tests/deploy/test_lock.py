"""requirements.lock: complete, hashed, and without a word of where things come from."""

from __future__ import annotations

import re
import tomllib

import pytest
from packaging.requirements import Requirement

from gemelo.libraries.runtime.deployment import project_root

ROOT = project_root()
LOCKS = [
    ROOT / "requirements.lock",
    ROOT / "deploy/tools/docs.lock",
    ROOT / "deploy/tools/uv.lock",
    ROOT / "deploy/tools/go.lock",
]


PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
EXTRAS = [name for names in PYPROJECT["project"]["optional-dependencies"].values() for name in names]
REQUIREMENTS = {
    "requirements.lock": PYPROJECT["project"]["dependencies"] + EXTRAS,
    "deploy/tools/docs.lock": PYPROJECT["dependency-groups"]["docs"],
}


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.name)
def test_a_lock_holds_no_download_address(lock):
    assert not re.search(r"https?://|file://|--(extra-)?index|--find-links| @ ", lock.read_text())


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.name)
def test_every_package_of_a_lock_is_pinned_by_hash(lock):
    entries = re.split(r"\n(?=[a-z0-9])", lock.read_text(), flags=re.IGNORECASE)
    packages = [entry for entry in entries if not entry.startswith("#")]
    assert packages
    for entry in packages:
        assert re.match(r"[\w.-]+==\S+", entry), entry
        assert "--hash=sha256:" in entry, entry


@pytest.mark.parametrize("lock", REQUIREMENTS)
def test_every_requirement_is_locked_at_a_version_of_its_range(lock):
    locked = dict(re.findall(r"^([\w.-]+)==([^ ;\\]+)", (ROOT / lock).read_text(), re.MULTILINE))
    for each in map(Requirement, REQUIREMENTS[lock]):
        versions = [version for name, version in locked.items() if name == each.name]
        assert each.specifier, f"{each} has no range"
        assert versions, f"{each} is not in the lock: make lock"
        assert each.marker or each.specifier.contains(versions[0]), f"{each} is locked at {versions[0]}: make lock"
