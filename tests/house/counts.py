"""The house in figures: `python -m tests.house.counts` prints them; test_house.py holds those that may not grow."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TypeGuard

ROOT = Path(__file__).parents[2]
LINKED = ("firmware", "libraries", "schemas", "services", "tools")  # folders of the root that gemelo/ links to
ROOMS = ("docs", "examples", "gemelo", "integrations", "tests", *LINKED)
TUNED = ("services/planner/", "services/stepper_gateway/")  # whose constants say where their values come from
ORIGIN = re.compile(r"\b(?:[Cc]hosen|[Mm]easured|[Ss]tandard|[Rr]ounding|rounded)\b")
REASON = 3  # words of a comment, besides units, that can say why
FRAGMENT = 40  # lines: a shorter file with one importer is a part of it
NUMBERS = {"float", "Array", "NDArray"}
UNIT = re.compile(
    r"\[(?:%|1/|(?:A|B|bytes|days|deg|Hz|instructions|kg|m|MB|min|mm|ms|N|ns|pixels|ppm|px|rad|rev|s|share|steps?|us|V)\b)"
    r"[^\[\]\"']*\]|\b(?:dimensionless|per cent|fractions?|quaternions?|ratios?|scales?|shares?|units?)\b"
)
SIZE = r"(?:\.\.\.|(?:\d+ )?\w+(?: [-+*] (?:\d+ )?\w+)*)"  # of a shape: n, 3, "2 n - 1", "..."
SHAPE = re.compile(rf"\({SIZE},(?:\s{SIZE}(?:,\s{SIZE})*)?(?:; [^()]*)?\)")
NAMES_ITS_UNIT = re.compile(r".*(?:seconds|minutes|_(?:deg|hz|mb|minutes|mm|ms|ns|ppm|s|us)|^per_\w+)")


@dataclass(frozen=True)
class Module:
    """One Python file; `name` as it is imported."""

    path: Path
    name: str
    text: str = field(repr=False)

    @property
    def lines(self) -> int:
        return len(self.text.splitlines())

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.text)

    @property
    def is_product(self) -> bool:
        return "tests" not in self.path.parts

    def functions(self) -> Iterator[int]:
        """The lines of each."""
        for node in ast.walk(self.tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                yield (node.end_lineno or node.lineno) - node.lineno + 1

    def imported(self, with_types: bool = False) -> Iterator[tuple[str, str]]:
        """Each module, and what of it, that is imported when it runs, at its top or later; `with_types` what only types
        need as well."""
        waiting: list[ast.AST] = [self.tree]
        while waiting:
            node = waiting.pop()
            if not with_types and isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
                waiting += node.orelse
                continue
            if isinstance(node, ast.Import):
                yield from ((alias.name, "") for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module:
                yield from ((node.module, f"{node.module}.{alias.name}") for alias in node.names)
            waiting += ast.iter_child_nodes(node)


def modules(root: Path = ROOT) -> dict[str, Module]:
    """Every Python file of the house, by its name."""
    found = {}
    for path in sorted(path for room in ROOMS for path in (root / room).rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        if parts[0] in LINKED:
            name = f"gemelo.{name}"
        found[name] = Module(path.relative_to(root), name, path.read_text())
    return found


def imports(house: dict[str, Module], with_types: bool = False) -> dict[str, set[str]]:
    """The modules of the house that each imports, as `Module.imported`; of a package's module that module alone."""
    found = {}
    for name, module in house.items():
        others = {part if part in house else whole for whole, part in module.imported(with_types)}
        found[name] = {other for other in others if other in house and other != name}
    return found


def circles(edges: dict[str, set[str]]) -> list[set[str]]:
    """Modules that import one another over any number of steps."""
    reached = {name: _reached(edges, name) for name in edges}
    found = [{name, *(other for other in reached[name] if name in reached[other])} for name in edges]
    return [circle for place, circle in enumerate(found) if len(circle) > 1 and circle not in found[:place]]


def _reached(edges: dict[str, set[str]], start: str) -> set[str]:
    seen: set[str] = set()
    waiting = [start]
    while waiting:
        new = edges[waiting.pop()] - seen
        seen |= new
        waiting += new
    return seen


def fragments(house: dict[str, Module]) -> dict[str, str]:
    """Files of the product under `FRAGMENT` lines that one other file imports, and no table names; with that one."""
    edges = imports(house)
    found = {}
    for name, module in house.items():
        importers = [other for other in house if name in edges[other]]
        is_short = module.is_product and module.lines < FRAGMENT and module.path.name != "__init__.py"
        if is_short and len(importers) == 1 and not is_named(house, name):
            found[name] = importers[0]
    return found


def is_named(house: dict[str, Module], name: str) -> bool:
    """True if a table of its package names it, as "module:function", to load it when it is used."""
    package, _, own = name.rpartition(".")
    return any(f'"{own}:' in module.text for other, module in house.items() if other.rpartition(".")[0] == package)


def without_unit(module: Module) -> Iterator[str]:
    """Public functions of numbers whose docstring has fewer units and shapes than numbers that it does not name.

    A number is an argument of floats or of an array, or such a result; one that the docstring names is taken to be
    explained there. A method without a docstring does what the method of its interface says.
    """
    waiting: list[tuple[str, ast.AST]] = [("", module.tree)]
    while waiting:
        within, node = waiting.pop()
        for each in ast.iter_child_nodes(node):
            if isinstance(each, ast.ClassDef) and not each.name.startswith("_"):
                waiting.append((f"{within}{each.name}.", each))
            elif isinstance(each, ast.FunctionDef) and not each.name.startswith("_") and any(_numbers(each)):
                text = ast.get_docstring(each)
                if (text is not None or not within) and not _says_units(each, (text or "").partition(">>>")[0]):
                    yield f"{module.name}.{within}{each.name}"


def _says_units(function: ast.FunctionDef, text: str) -> bool:
    units = len(UNIT.findall(text)) + len(SHAPE.findall(text))
    unnamed = [name for name in _numbers(function) if not name or not re.search(rf"\b{name}\b", text)]
    return units >= max(1, sum(not NAMES_ITS_UNIT.match(name) for name in unnamed))


def _numbers(function: ast.FunctionDef) -> Iterator[str]:
    """The arguments that are numbers, by name, and "" for a result that is."""
    arguments = [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]
    for name, note in [*((each.arg, each.annotation) for each in arguments), ("", function.returns)]:
        if note and any(isinstance(node, ast.Name) and node.id in NUMBERS for node in ast.walk(note)):
            yield name


def without_excuse(module: Module) -> Iterator[str]:
    """Functions that import, and have no comment beside or above one of these imports that says why not at the top."""
    lines = module.text.splitlines()
    for function in ast.walk(module.tree):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            late = [node for node in ast.walk(function) if isinstance(node, ast.Import | ast.ImportFrom)]
            near = [line for node in late for line in lines[node.lineno - 2 : node.end_lineno]]
            if late and not any("# " in line for line in near):
                yield f"{module.name}.{function.name}"


# What belongs to nobody's inside though its name begins so, or has no other way to it.
PUBLIC = {"_replace": "of a named tuple, as its documentation says"}
FOREIGN = {
    "_actions": "argparse lists the options of a parser nowhere else",
    "_get_local_constants": "hypothesis has no setting for the numbers that it takes from modules",
    "_local_constants": "the same",
    "_websock_server": "viser tells nobody what it keeps for a browser",
    "_broadcast_buffer": "the same",
    "_client_state_from_id": "the same",
    "_id": "pytest-xdist names the group of a test in its id, and pytest has no setter for it",
}
SETTERS = {"setattr", "getattr", "delattr", "object"}  # of Python, of monkeypatch, and `patch.object`


def pokes(module: Module) -> Iterator[str]:
    """Private names of others that the module reads, writes, imports or replaces; those that it defines are its own."""
    nodes = list(ast.walk(module.tree))
    own = {node.name for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)}
    own |= {node.attr for node in nodes if _is_of_self(node) and isinstance(node.ctx, ast.Store)}
    for node in nodes:
        names: list[str] = []
        if isinstance(node, ast.Attribute) and not _is_of_self(node):
            names = [node.attr]
        elif isinstance(node, ast.ImportFrom):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] in SETTERS:
            names = [each.value for each in node.args[1:2] if isinstance(each, ast.Constant)]
        for name in names:
            if _is_private(name) and name not in own | PUBLIC.keys() | FOREIGN.keys():
                yield f"{module.path}:{node.lineno}: {name}"


def _is_of_self(node: ast.AST) -> TypeGuard[ast.Attribute]:
    return isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")


def _is_private(name: object) -> bool:
    return isinstance(name, str) and name.startswith("_") and not name.startswith("__")


def without_origin(module: Module) -> Iterator[str]:
    """Numbers that are constants of the module without a comment that says what they are and where they come from:
    chosen, measured or standard, there or in the heading of their block."""
    heading, lines = "", module.text.splitlines()
    for node in module.tree.body:
        above, first = [], node.lineno - 2
        while first >= 0 and lines[first].startswith("#"):
            above.insert(0, lines[first])
            first -= 1
        if above and above[0].startswith("# Tuning constants:"):
            heading = above.pop(0)
        elif first >= 0 and not lines[first]:
            heading = ""
        if (
            isinstance(node, ast.Assign)
            and ast.unparse(node.targets[0]).strip("(_").isupper()
            and _is_number(node.value)
        ):
            said = " ".join([*above, *(line.partition("  # ")[2] for line in lines[node.lineno - 1 : node.end_lineno])])
            words = re.findall(r"[A-Za-z]{2,}", re.sub(r"\[[^\]]*\]", "", said))
            if len(words) < REASON or not ORIGIN.search(said + heading):
                yield f"{module.name}: {ast.unparse(node)}"


CONSTANT = re.compile(r"^(?:    static )?constexpr (?:u?int\d*_t|size_t|bool|double) (k\w+)(?:\[\])? = ([^;]*);(.*)$")
IN_WORDS = re.compile(r"\bfollows from\b")  # C++ alone: of other constants, a mask or a layout
# Names of values.
NAMES = re.compile(r"^k(?:Flag\w+|None|NoJoint|Never|Micro|Required|Optional|Magic|ProtocolVersion)$")


def without_origin_in_core(text: str) -> Iterator[str]:
    """Numbers that are constants of a file of the firmware core without a comment, on the line or above it, that says
    where they come from: chosen, measured, standard, or what they follow from. Those made of others alone need none."""
    above = ""
    for line in text.splitlines():
        found = CONSTANT.match(line)
        if found and not NAMES.match(found[1]) and re.search(r"(?<![\w.])\d", found[2]) and "sizeof" not in found[2]:
            said = above + found[3]
            is_made = re.search(r"\bk[A-Z]\w+", found[2]) and not re.search(r"(?<![\w.])(?!1(?:u|ll|\b))\d", found[2])
            if not is_made and not ORIGIN.search(said) and not IN_WORDS.search(said):
                yield found[1]
        above = above + line if line.lstrip().startswith("//") else ""


def _is_number(value: ast.expr) -> bool:
    """True for a number or a tuple of numbers, also where they are computed of numbers alone."""
    leaves = [node for node in ast.walk(value) if not isinstance(node, ast.operator | ast.unaryop | ast.expr_context)]
    are_plain = all(isinstance(node, ast.Constant | ast.BinOp | ast.UnaryOp | ast.Tuple) for node in leaves)
    numbers = [node for node in leaves if isinstance(node, ast.Constant)]
    return are_plain and bool(numbers) and all(type(node.value) in (int, float) for node in numbers)


def spread(values: list[int]) -> str:
    """Median, 90th percentile and largest."""
    ordered = sorted(values)
    return f"median {ordered[len(ordered) // 2]}, p90 {ordered[int(0.9 * (len(ordered) - 1))]}, at most {ordered[-1]}"


def main() -> int:
    """The figures, of the product and of its tests."""
    house = modules()
    for title, is_product in (("product", True), ("tests", False)):
        part = [module for module in house.values() if module.is_product is is_product]
        lines = [module.lines for module in part]
        short = [module for module in part if module.lines < FRAGMENT and module.path.name != "__init__.py"]
        print(
            f"{title}: {len(part)} files, {sum(lines)} lines; under {FRAGMENT} lines, __init__ left out: {len(short)}"
        )
        print(f"  lines of a file: {spread([count for count in lines if count > 1])}")
        print(f"  lines of a function: {spread([count for module in part for count in module.functions()])}")
    numeric = [name for module in house.values() if module.is_product for name in without_unit(module)]
    print(f"circles of imports, those of types among them: {len(circles(imports(house, with_types=True)))}")
    print(f"fragments: {fragments(house) or 0}")
    print(f"public functions of numbers without a unit: {len(numeric)}")
    if "--names" in sys.argv:
        print(*numeric, sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
