"""Refusals of parameters, of the file that keeps them and of a router: the code and the values of each cause."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import msgspec
import pytest
from msgspec import Meta

from gemelo.libraries.runtime.bus.router import router_setup
from gemelo.libraries.runtime.errors import RequestRefused
from gemelo.libraries.runtime.parameters import ParameterSet
from gemelo.libraries.runtime.saved_parameters import SavedParameters
from gemelo.schemas.deployment import RouterSection
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.reasons import Reason, Value, because, remedy
from gemelo.schemas.system import ParameterValue


class Rates(msgspec.Struct, frozen=True, kw_only=True):
    rate: Annotated[float, Meta(description="of the loop", gt=0)] = 1.0
    label: str = ""


def refused(cause: Callable[[], object]) -> Reason:
    with pytest.raises(RequestRefused) as caught:
        cause()
    return caught.value.reason


@pytest.mark.parametrize(
    ("name", "value", "code", "more"),
    [
        ("rate", True, "parameter.type", {"type": "float"}),
        ("rate", -1.0, "parameter.value", {}),
        ("rate", float("inf"), "parameter.not_finite", {}),
        ("label", "a\0b", "parameter.nul", {}),
    ],
)
def test_a_value_that_cannot_be_names_it(name: str, value: ParameterValue, code: str, more: dict[str, Value]) -> None:
    why = refused(lambda: ParameterSet(Rates, "planner").set(name, value))
    assert (why.code, why.values) == (code, {"node": "planner", "name": name, "value": repr(value), **more})


def test_a_name_that_is_not_known_has_the_nearest() -> None:
    hint = remedy("did_you_mean", name="rate")
    assert refused(lambda: ParameterSet(Rates, "planner").set("rat", 1.0)) == because(
        "parameter.unknown", hint, node="planner", name="rat"
    )


def test_where_a_wrong_value_stood_is_named() -> None:
    why = refused(lambda: ParameterSet(Rates, "planner").set_all({"rat": 1.0}, "planner.toml, line 3", True))
    assert (why.code, why.values) == ("parameter.from", {"origin": "planner.toml, line 3"})


def test_a_file_that_cannot_be_used_says_where(tmp_path: Path) -> None:
    saved = SavedParameters(tmp_path, "planner")
    saved.path.parent.mkdir(parents=True)
    saved.path.write_text("rate = [1]\n")
    why = because("parameter.file.value", name="rate", value="[1]")
    assert refused(saved.read) == because("parameter.from", why, origin=f"{saved.path}, line 1")
    saved.path.write_bytes(b"rate = \xf1\n")
    assert refused(saved.read).code == "parameter.file.unreadable"
    saved.path.write_text("rate = \n")
    assert refused(saved.read).values["origin"] == f"{saved.path}, line 1"
    saved.path.unlink()
    saved.path.parent.rmdir()
    saved.path.parent.write_text("a file in the place of the folder")
    unwritable = because("parameter.file.unwritable", file=str(saved.path), error="Not a directory")
    assert refused(lambda: saved.keep({"rate": 1.0})) in (
        unwritable,
        because("parameter.file.unwritable", file=str(saved.path), error="File exists"),
    )


def test_a_router_with_tls_needs_its_file() -> None:
    with pytest.raises(ConfigurationError) as alone:
        router_setup(RouterSection(tls=True))
    assert alone.value.reason == because("router.tls_alone")
    with pytest.raises(ConfigurationError) as absent:
        router_setup(RouterSection(configuration="nowhere.json5"))
    assert absent.value.reason.code == "router.configuration"
    assert absent.value.reason.values["file"] == "nowhere.json5"
