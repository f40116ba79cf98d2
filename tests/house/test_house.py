"""Limits on the form of the code: no circles of imports, no fragments, units, module docstrings that say what it is."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tests.house.counts import ROOMS, ROOT, Module, circles, fragments, imports, modules, without_unit

KEPT = {
    "services.planner.parameters": "as the parameters of every service",
    "services.panel.view.pick_box": "a part of the page, as all its boxes",
    "services.stepper_gateway.ledger.reasons": "the sentences, apart from the arithmetic",
}
CLAUSES = {"What", "Where", "How", "Whether", "Who", "When", "Which", "Why", "Whatever", "True", "From", "By", "For"}


@pytest.fixture(scope="module")
def house() -> dict[str, Module]:
    return modules()


def test_no_module_imports_itself_over_others(house):
    assert circles(imports(house)) == []


def test_a_short_file_with_one_importer_is_a_part_of_that(house):
    assert {name: by for name, by in fragments(house).items() if name not in KEPT} == {}


def test_nothing_of_the_product_imports_a_test(house):
    edges = imports(house)
    product = [name for name in house if house[name].is_product]
    assert [name for name in product if any(not house[other].is_product for other in edges[name])] == []


def test_every_public_function_of_numbers_says_its_units_or_shapes(house):
    assert [name for each in house.values() if each.is_product for name in without_unit(each)] == []


def test_every_module_docstring_says_what_the_module_is(house):
    """By a noun or a verb at its beginning; a clause such as "What the gateway says" makes the reader guess."""
    beginnings = {name: (ast.get_docstring(each.tree) or "").partition(" ")[0] for name, each in house.items()}
    assert [name for name, word in beginnings.items() if word in CLAUSES] == []


def test_every_cpp_file_says_what_it_is():
    files = [path for room in ROOMS for kind in ("*.h", "*.cpp") for path in (ROOT / room).rglob(kind)]
    first_words = {path: path.read_text().partition("\n")[0].removeprefix("// ").partition(" ")[0] for path in files}
    assert [str(path) for path, word in first_words.items() if "build" not in path.parts and word in CLAUSES] == []


def module(name: str, *lines: str) -> tuple[str, Module]:
    return name, Module(Path(f"{name}.py"), name, "\n".join(lines))


def test_a_circle_is_seen_and_one_of_types_alone_is_none():
    three = dict([module("a", "import b"), module("b", "def f():", "    from c import x"), module("c", "import a")])
    assert circles(imports(three)) == [{"a", "b", "c"}]
    types = dict([module("a", "import b"), module("b", "if TYPE_CHECKING:", "    import a")])
    assert circles(imports(types)) == []


def test_a_fragment_is_seen_unless_two_import_it_or_a_table_names_it():
    part, whole = module("part", "x = 1"), module("whole", "import part", *["x = 1"] * 50)
    assert fragments(dict([part, whole])) == {"part": "whole"}
    assert fragments(dict([part, whole, module("other", "import part")])) == {}
    assert fragments(dict([part, whole, module("table", 'COMMANDS = {"go": "part:run"}')])) == {}


def test_a_function_of_numbers_without_a_unit_is_seen():
    _, seen = module("a", "def f(x: float):", '    """Moves."""', "def g(x: float):", '    """Moves by `x` [m]."""')
    assert list(without_unit(seen)) == ["a.f"]
