"""The pytest plugin: the fixture `arm` gives every test that asks for it a simulated twin of its own.

    def test_my_program(arm):
        arm.move(named="ready")

Of which arm, in pytest's configuration (`gemelo_robot`, `gemelo_cell`, `gemelo_start`, `gemelo_seed`), or for one test
or module by a marker with the arguments of `gemelo.simulate`: `@pytest.mark.gemelo(robot="parol6", start="home")`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    import gemelo

OPTIONS = {
    "gemelo_robot": "the arm of the fixture `arm`: a folder of urdf/, or a path; the deployment's if left out",
    "gemelo_cell": "its cell.toml, with which cameras see",
    "gemelo_start": 'its named state at the beginning, or "unreferenced"',
    "gemelo_seed": "the seed of what is drawn [1]",
}
MARKER = "gemelo(robot, **options): the arguments of gemelo.simulate for the fixture `arm`"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declares the options of the configuration."""
    for name, about in OPTIONS.items():
        parser.addini(name, about, default="")


def pytest_configure(config: pytest.Config) -> None:
    """Declares the marker."""
    config.addinivalue_line("markers", MARKER)


@pytest.fixture
def arm(request: pytest.FixtureRequest) -> Iterator[gemelo.SimulatedArm]:
    """A simulated arm, referenced and armed; another one for every test."""
    import gemelo  # slow to load: for tests that ask for an arm alone

    options = _configured(request.config)
    marker = request.node.get_closest_marker("gemelo")
    if marker is not None:
        options |= dict(zip(("robot",), marker.args, strict=False)) | marker.kwargs
    robot = options.pop("robot", "")
    with gemelo.simulate(robot, **options) as simulated:
        yield simulated


def _configured(config: pytest.Config) -> dict[str, Any]:
    """The arguments of `gemelo.simulate` that the configuration names."""
    said = {name.removeprefix("gemelo_"): config.getini(name) for name in OPTIONS}
    options: dict[str, Any] = {name: value for name, value in said.items() if value}
    if "seed" in options:
        try:
            options["seed"] = int(options["seed"])
        except ValueError:
            raise pytest.UsageError(f"gemelo_seed = {options['seed']}: it must be a whole number, as 1") from None
    return options
