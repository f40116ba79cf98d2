"""Limits on the form of the code: no circles of imports, no fragments, units, module docstrings that say what it is."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tests.house.counts import (
    ROOMS,
    ROOT,
    TUNED,
    Module,
    circles,
    fragments,
    imports,
    modules,
    pokes,
    without_excuse,
    without_origin,
    without_origin_in_core,
    without_unit,
)

KEPT = {
    "gemelo.services.planner.parameters": "as the parameters of every service",
    "gemelo.services.panel.view.pick_box": "a part of the page, as all its boxes",
    "gemelo.libraries.runtime.process.freed_memory": "the C library's heap, apart from the main of services",
}
LOOKERS = ("tests/", "tools/bench/", "tools/chaos/", "tools/demo/", "docs/", "examples/")
CLAUSES = {"What", "Where", "How", "Whether", "Who", "When", "Which", "Why", "Whatever", "True", "From", "By", "For"}


@pytest.fixture(scope="module")
def house() -> dict[str, Module]:
    return modules()


def test_no_module_imports_itself_over_others_not_for_its_types_either(house):
    assert circles(imports(house, with_types=True)) == []


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


def test_an_import_within_a_function_says_why(house):
    """Mostly as the library is slow to load, and not needed by all who import the module."""
    assert [found for each in house.values() if each.is_product for found in without_excuse(each)] == []


def test_an_import_within_a_function_without_a_reason_is_seen():
    late = ["def f():", "    import b", "    return b"]
    assert list(without_excuse(module("a", *late)[1])) == ["a.f"]
    assert list(without_excuse(module("a", late[0], "    import b  # slow to load", late[2])[1])) == []
    assert list(without_excuse(module("a", "import b", late[0], late[2])[1])) == []


def test_every_tuning_constant_says_where_its_value_comes_from(house):
    """Measured (by what), standard, or chosen (with the reason)."""
    tuned = [each for each in house.values() if str(each.path).startswith(TUNED)]
    assert [found for each in tuned for found in without_origin(each)] == []


def test_every_constant_of_the_firmware_core_says_where_its_value_comes_from():
    files = [each for each in sorted((ROOT / "firmware/core").iterdir()) if each.suffix in {".h", ".cpp"}]
    assert len(files) > 60
    assert [f"{each.name}: {name}" for each in files for name in without_origin_in_core(each.read_text())] == []


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("constexpr size_t kSize = 512;", ["kSize"]),
        ("constexpr size_t kSize = 512;  // bytes", ["kSize"]),
        ("constexpr size_t kSize = 512;  // chosen", []),
        ("// Standard: RFC 1.\nconstexpr size_t kSize = 512;", []),
        ("// Standard: RFC 1.\nint a;\nconstexpr size_t kSize = 512;", ["kSize"]),
        ("    static constexpr uint8_t kPast = 8;", ["kPast"]),
        ("constexpr int64_t kFineStep = 1ll << kFineBits;", []),
        ("constexpr uint64_t kLongest = 4 * kSlotUs;", ["kLongest"]),
    ],
)
def test_a_constant_of_the_core_without_an_origin_is_seen(text, found):
    assert list(without_origin_in_core(text)) == found


def module(name: str, *lines: str) -> tuple[str, Module]:
    return name, Module(Path(f"{name}.py"), name, "\n".join(lines))


def test_what_tests_and_measures_look_at_is_public(house):
    """What they need has a name of its own, or is reached as a person or another module reaches it."""
    looking = [each for each in house.values() if str(each.path).startswith(LOOKERS)]
    assert [found for each in looking for found in pokes(each)] == []


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("page._move.problem", "_move"),
        ("pages()[0]._move = 1", "_move"),
        ("import a; a._move()", "_move"),
        ("from a import b, _move", "_move"),
        ('monkeypatch.setattr(page, "_move", None)', "_move"),
        ('with mock.patch.object(page, "_move"): pass', "_move"),
        ("page.move.problem", ""),
        ("page.__dict__", ""),
        ("here._replace(x=1.0)", ""),
        ('monkeypatch.setattr(page, "move", "_move")', ""),
        ("class A:\n    def f(self, other): return self._move, other.move", ""),
        ("class A:\n    def f(self, other): self._move = other._move", ""),
        ("class A:\n    def _move(self): pass\nA()._move()", ""),
    ],
)
def test_a_look_at_what_is_private_is_seen(line, name):
    assert [found.rpartition(" ")[2] for found in pokes(module("a", line)[1])] == ([name] if name else [])


def test_a_circle_is_seen_and_one_of_types_alone_too():
    three = dict([module("a", "import b"), module("b", "def f():", "    from c import x"), module("c", "import a")])
    assert circles(imports(three)) == [{"a", "b", "c"}]
    types = dict([module("a", "import b"), module("b", "if TYPE_CHECKING:", "    import a")])
    assert circles(imports(types)) == []
    assert circles(imports(types, with_types=True)) == [{"a", "b"}]


def test_a_fragment_is_seen_unless_two_import_it_or_a_table_names_it():
    part, whole = module("part", "x = 1"), module("whole", "import part", *["x = 1"] * 50)
    assert fragments(dict([part, whole])) == {"part": "whole"}
    assert fragments(dict([part, whole, module("other", "import part")])) == {}
    assert fragments(dict([part, whole, module("table", 'COMMANDS = {"go": "part:run"}')])) == {}


@pytest.mark.parametrize(
    ("arguments", "docstring", "is_enough"),
    [
        ("x: float", "Moves.", False),
        ("x: float", "Moves by `x` [m].", True),
        ("x: float", "Moves (not far).", False),
        ("x: float", "Moves, as in Moeller (Moeller and Trumbore, 1997).", False),
        ("x: float", "Moves ([1] of the references).", False),
        ("x: float", "Moves a little.\n\n    >>> f([1])", False),
        ("x: Array", "Moves along rows (m, n).", True),
        ("x: Array, y: float", "Moves along rows (m, n).", False),
        ("x: Array, y: float", "Moves along rows (m, n) by `y`.", True),
        ("x: Array, y: float", "Moves along rows (m, 2 n - 1) [m], a share of it.", True),
        ("x: Array, delay_us: float", "Moves along rows (m, n) later.", True),
        ("x: int", "Moves.", True),
    ],
)
def test_a_function_of_numbers_without_a_unit_is_seen(arguments, docstring, is_enough):
    _, seen = module("a", f"def f({arguments}):", f'    """{docstring}"""')
    assert list(without_unit(seen)) == ([] if is_enough else ["a.f"])


def test_a_result_without_a_unit_is_seen_too():
    lines = (
        "def f(x: float) -> float:",
        '    """Moves by `x` [m]."""',
        "def g(x: float) -> float:",
        '    """[s] for `x`."""',
    )
    assert list(without_unit(module("a", *lines)[1])) == []
    assert list(without_unit(module("a", "def f(x: float) -> float:", '    """Moves by x."""')[1])) == ["a.f"]


@pytest.mark.parametrize(
    ("lines", "is_enough"),
    [
        (["A = 5"], False),
        (["A = 5  # [m]"], False),
        (["A = 5  # [m] by which it may be off"], False),
        (["A = 5  # [m] by which it may be off; chosen: half a step"], True),
        (["# Standard: the protocol's own.", "A, B = 5, -2.0 * 3"], True),
        (["# Tuning constants: chosen.", "A = 5  # [m] by which it may be off", "B = 5"], False),
        (["# Tuning constants: chosen.", "A = 5  # [m] by which it may be off"], True),
        (["# Tuning constants: chosen.", "A = 5  # it may be off", "", "B = 5  # so many are tried"], False),
        (["a = 5", "A = True", "B = 'text'", "C = A"], True),
    ],
)
def test_a_constant_without_an_origin_is_seen(lines, is_enough):
    assert (list(without_origin(module("a", *lines)[1])) == []) is is_enough
