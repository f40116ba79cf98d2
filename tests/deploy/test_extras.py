"""A host installs only what it runs: every service starts with the extras that its row names, and nothing else."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from importlib.metadata import PackageNotFoundError, packages_distributions, requires

import pytest

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.extras import EXTRA_OF
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.topics import DESCRIPTION
from gemelo.services.state_publisher.main import describe
from gemelo.tools.hosts.layout import BROKER, SERVICES, extras
from tests.hosts.sites import EXAMPLE, site
from tests.runtime.support import RouterProcess

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
    "rosbags",
}
IN_A_PREFIX = {
    "pinocchio": ["pin"],
    "coal": ["coal"],
    "hppfcl": ["coal"],
    "ruckig": ["ruckig"],
}  # where metadata names no module
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
    loaded_by(module_of(service), ("stack", *SERVICES[service].extras))


def test_the_block_is_real():
    with pytest.raises(AssertionError, match="ModuleNotFoundError"):
        loaded_by("gemelo.services.planner.main", ("stack",))


def test_a_gateway_host_needs_the_stack_alone():
    assert not loaded_by(module_of("stepper_gateway"), ("stack",)) & NEVER_ON_A_GATEWAY


@pytest.mark.parametrize("module", ["gemelo.tools.cli.main", "gemelo"])
def test_a_person_s_script_and_command_line_need_no_extra(module):
    loaded_by(module, ())


def test_every_extra_that_a_service_names_is_there_and_every_extra_for_use_is_named():
    named = {extra for each in SERVICES.values() for extra in each.extras}
    assert named <= set(EXTRAS)
    assert set(EXTRAS) - named == {
        "broker",
        "dev",
        "bench",
        "build",
        "ros",  # of a process that is started by hand
        "stack",  # of every host that runs a service
        "lerobot",  # of a person who exports recordings
    }  # the embedded broker is for one machine: a site has mosquitto
    assert not SERVICES[BROKER].extras


def test_a_host_needs_the_extras_of_its_services(tmp_path):
    example = site(tmp_path)
    assert EXAMPLE.is_file()
    assert extras(example, "cell") == ()
    assert extras(example, "brain") == ("planner", "record")
    assert extras(example, "desk") == ("panel",)


CLIENT = """
import gemelo
from gemelo.tools.cli.main import run
with gemelo.connect({address!r}) as arm:
    assert len(arm.joint_names) == 3
assert run(["--robot", {address!r}, "node", "list"]) == 0
assert run(["--simulate", "state"]) == 1
try:
    gemelo.simulate("rm1")
except gemelo.Error as error:
    assert error.reason.code == "extra.missing", error
"""


def test_a_client_connects_with_zenoh_and_msgspec_alone_and_says_what_it_lacks(tmp_path):
    router = RouterProcess(tmp_path)
    program = tmp_path / "client_of_mine.py"
    program.write_text(CLIENT.format(address=f"tcp/127.0.0.1:{router.port}"))
    whole = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n" + IMPORT.format(
        blocked=blocked_for(()), module="client_of_mine"
    )
    try:
        with (
            Node("stepper_gateway", router.deployment, robot="rm1", stop=ShutdownRequest()),
            Node("state_publisher", router.deployment, robot="rm1", stop=ShutdownRequest()) as publisher,
        ):
            publisher.publisher(DESCRIPTION).put(describe(load_arm(ROOT / "urdf/rm1")))
            done = subprocess.run([sys.executable, "-c", whole], cwd=ROOT, capture_output=True, text=True, check=False)
    finally:
        router.kill()
    assert done.returncode == 0, done.stderr
    assert "stepper_gateway" in done.stdout
    assert 'pip install "gemelo[stack]"' in done.stderr


def test_every_module_of_an_extra_for_use_names_it():
    modules = {**IN_A_PREFIX, **packages_distributions()}
    used = {extra: {name_of(each) for each in EXTRAS[extra]} for extra in set(EXTRA_OF.values())}
    for module, extra in EXTRA_OF.items():
        owners = {name_of(each) for each in modules.get(module, [])}
        assert not owners or owners & used[extra], f"{module} is none of {extra}"
    told = {name_of(owner) for module in EXTRA_OF for owner in modules.get(module, [])}
    assert {name for names in used.values() for name in names} <= told
