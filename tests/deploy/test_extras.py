"""A host installs only what it runs: every service starts with the extras that its row names, and nothing else."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from importlib.metadata import PackageNotFoundError, packages_distributions, requires

import pytest

from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.hosts.layout import BROKER, SERVICES, extras
from tests.hosts.sites import EXAMPLE, site

ROOT = project_root()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
NEVER_ON_A_GATEWAY = {
    "rerun",
    "pinocchio",
    "coal",
    "ompl",
    "toppra",
    "viser",
    "cv2",
    "trimesh",
    "scipy",
    "mcap",
}
IN_A_PREFIX = {"pinocchio": ["pin"], "coal": ["coal"], "hppfcl": ["coal"]}  # where metadata names no module
IMPORT = """
import importlib, importlib.machinery, sys
blocked = set({blocked!r})
class OnlyInstalled(importlib.machinery.PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name.split(".")[0] in blocked else super().find_spec(name, path, target)
started = set(sys.modules)  # with what .pth files load
sys.meta_path[:] = [OnlyInstalled if each is importlib.machinery.PathFinder else each for each in sys.meta_path]
importlib.import_module({module!r})
loaded = {{name.split(".")[0] for name in set(sys.modules) - started}}
assert not loaded & blocked, loaded & blocked
print(" ".join(sorted(loaded)))
"""


def name_of(requirement: str) -> str:
    """A distribution's name as metadata compares it."""
    found = re.match(r"[\w.-]+", requirement)
    assert found is not None
    return re.sub(r"[-_.]+", "-", found[0]).lower()


def closure(requirements: list[str]) -> set[str]:
    """All distributions that come with them here."""
    found: set[str] = set()
    waiting = [name_of(each) for each in requirements]
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        found.add(name)
        try:
            needed = requires(name) or []
        except PackageNotFoundError:  # not for this Python or machine
            continue
        waiting += [name_of(each) for each in needed if "extra ==" not in each]
    return found


def blocked_for(chosen: tuple[str, ...]) -> list[str]:
    """The modules of every installed distribution that neither the base nor these extras bring."""
    allowed = closure([*PROJECT["dependencies"], *(each for extra in chosen for each in EXTRAS[extra])])
    allowed |= {"gemelo"}
    ours = {"gemelo"}
    owners_of = {**packages_distributions(), **IN_A_PREFIX}
    return sorted(
        module
        for module, owners in owners_of.items()
        if module not in ours and not {name_of(each) for each in owners} & allowed
    )


def loaded_by(module: str, chosen: tuple[str, ...]) -> set[str]:
    program = IMPORT.format(blocked=blocked_for(chosen), module=module)
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


def module_of(service: str) -> str:
    return str(PROJECT["scripts"][f"gemelo-{service.replace('_', '-')}"].split(":")[0])


@pytest.mark.parametrize("service", SERVICES)
def test_a_service_is_imported_with_only_the_extras_that_it_names(service):
    loaded_by(module_of(service), SERVICES[service].extras)


def test_the_block_is_real():
    with pytest.raises(AssertionError, match="ModuleNotFoundError"):
        loaded_by("gemelo.services.planner.main", ())


@pytest.mark.parametrize("module", [module_of("stepper_gateway"), "gemelo.tools.cli.main", "gemelo"])
def test_a_gateway_host_and_a_person_need_no_extra(module):
    assert not loaded_by(module, ()) & NEVER_ON_A_GATEWAY


def test_every_extra_that_a_service_names_is_there_and_every_extra_for_use_is_named():
    named = {extra for each in SERVICES.values() for extra in each.extras}
    assert named <= set(EXTRAS)
    assert set(EXTRAS) - named == {
        "broker",
        "dev",
        "bench",
        "build",
    }  # the embedded broker is for one machine: a site has mosquitto
    assert not SERVICES[BROKER].extras


def test_a_host_needs_the_extras_of_its_services(tmp_path):
    example = site(tmp_path)
    assert EXAMPLE.is_file()
    assert extras(example, "cell") == ()
    assert extras(example, "brain") == ("planner", "record")
    assert extras(example, "desk") == ("panel",)
