"""Interpreter of the expressions in a xacro file: plain data and the documented functions; Python's `eval` is not used.

Each kind of node of the syntax tree has one function in `KINDS`; a kind that is not there is refused.
"""

from __future__ import annotations

import ast
import operator
import re
import string
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import because

NOT_ADMITTED = "import.xacro.not_admitted"
LONGEST = 100_000  # letters or elements of one value, chosen: a robot's longest list has some hundred
MOST_BITS = 1024  # of an integer, chosen: a double has 53
MOST_STEPS = 200_000  # nodes visited by one expression, chosen
WIDE = re.compile(r"\*|\d{4}")  # the width of a format that is taken from a value, or has four digits
PLAIN = (bool, int, float, str, list, tuple, dict, set, frozenset, range, type(None))
OF_A_TEXT = """
    capitalize count endswith find format index isalnum isalpha isdigit isnumeric join lower lstrip partition replace
    rpartition rsplit rstrip split startswith strip title upper
"""
METHODS: Mapping[type, frozenset[str]] = {
    str: frozenset(OF_A_TEXT.split()),
    dict: frozenset({"get", "items", "keys", "values"}),
    list: frozenset({"count", "index"}),
    tuple: frozenset({"count", "index"}),
}


class ExpressionRefused(ReasonedError):
    """The expression is outside of what is admitted; the reason says what of it, and its limit."""


class Names:
    """A group of functions and values, as `math`: what follows its dot."""

    def __init__(self, members: Mapping[str, Any]) -> None:
        self.members = members


class Interpreter:
    """`functions` are all that may be called, besides the methods of plain data in `METHODS`; a property of a group
    follows its dot: the groups are `Names`, and the type `namespace` of xacro's `<xacro:include ns=...>`."""

    def __init__(self, functions: Iterable[Callable[..., Any]], namespace: type = Names) -> None:
        self._functions, self._namespace = list(functions), namespace

    def evaluate(self, text: str, names: Mapping[str, Any]) -> Any:
        """The value of an expression; raises `ExpressionRefused`, SyntaxError, and what its operations raise."""
        tree = ast.parse(text.strip(), mode="eval")
        return _Evaluation(self._functions, self._namespace, names).value(tree.body)


class _Evaluation:
    """One expression, with the steps that it has taken."""

    def __init__(self, functions: list[Callable[..., Any]], namespace: type, names: Mapping[str, Any]) -> None:
        self._functions, self._namespace, self._names, self._steps = functions, namespace, names, 0

    def value(self, node: ast.expr) -> Any:
        self._steps += 1
        if self._steps > MOST_STEPS:
            raise ExpressionRefused(because("import.xacro.steps", most=MOST_STEPS))
        kind = KINDS.get(type(node))
        if kind is None:
            raise ExpressionRefused(because(NOT_ADMITTED, what=type(node).__name__))
        return _bounded(kind(self, node))

    def constant(self, node: ast.Constant) -> Any:
        if not isinstance(node.value, PLAIN):
            raise ExpressionRefused(because(NOT_ADMITTED, what=repr(node.value)))
        return node.value

    def name(self, node: ast.Name) -> Any:
        try:
            return self._names[node.id]
        except KeyError:
            raise NameError(f"name '{node.id}' is not defined") from None

    def binary(self, node: ast.BinOp) -> Any:
        apply = OPERATIONS.get(type(node.op))
        if apply is None:
            raise ExpressionRefused(because(NOT_ADMITTED, what=type(node.op).__name__))
        return apply(self.value(node.left), self.value(node.right))

    def unary(self, node: ast.UnaryOp) -> Any:
        return UNARY[type(node.op)](self.value(node.operand))

    def boolean(self, node: ast.BoolOp) -> Any:
        is_and, last = isinstance(node.op, ast.And), None
        for each in node.values:
            last = self.value(each)
            if bool(last) is not is_and:
                break
        return last

    def comparison(self, node: ast.Compare) -> bool:
        left = self.value(node.left)
        for kind, each in zip(node.ops, node.comparators, strict=True):
            right = self.value(each)
            if not COMPARISONS[type(kind)](left, right):
                return False
            left = right
        return True

    def choice(self, node: ast.IfExp) -> Any:
        return self.value(node.body if self.value(node.test) else node.orelse)

    def listed(self, node: ast.List | ast.Tuple | ast.Set) -> Any:
        made = {ast.List: list, ast.Tuple: tuple, ast.Set: set}[type(node)]
        return made([self.value(each) for each in node.elts])

    def mapped(self, node: ast.Dict) -> dict[Any, Any]:
        if None in node.keys:
            raise ExpressionRefused(because(NOT_ADMITTED, what="**"))
        return {self.value(key): self.value(value) for key, value in zip(node.keys, node.values, strict=True) if key}

    def subscript(self, node: ast.Subscript) -> Any:
        whole = self.value(node.value)
        if not isinstance(whole, PLAIN):
            raise ExpressionRefused(because("import.xacro.subscript", kind=type(whole).__name__))
        return operator.getitem(whole, self._place(node.slice))  # type: ignore[arg-type]  # TypeError is an answer

    def _place(self, node: ast.expr) -> Any:
        if not isinstance(node, ast.Slice):
            return self.value(node)
        return slice(*(None if each is None else self.value(each) for each in (node.lower, node.upper, node.step)))

    def attribute(self, node: ast.Attribute) -> Any:
        """A property of a namespace, or the value of a key: never an attribute of an object of Python."""
        whole = self.value(node.value)
        if isinstance(whole, (Names, self._namespace)):
            members: Any = whole.members if isinstance(whole, Names) else whole
            try:
                return members[node.attr]
            except KeyError:
                raise NameError(f"name '{node.attr}' is not defined") from None
        if isinstance(whole, dict) and not node.attr.startswith("_"):
            if node.attr in whole:
                return whole[node.attr]
            raise KeyError(f"there is no key '{node.attr}'")
        if isinstance(whole, PLAIN):
            kind = type(whole).__name__
            raise ExpressionRefused(because("import.xacro.attribute", attribute=node.attr, kind=kind))
        raise ExpressionRefused(because("import.xacro.attribute.strange", attribute=node.attr))

    def call(self, node: ast.Call) -> Any:
        if any(isinstance(each, ast.Starred) for each in node.args) or any(each.arg is None for each in node.keywords):
            raise ExpressionRefused(because("import.xacro.starred"))
        function = self._function(node.func)
        arguments = [self.value(each) for each in node.args]
        return function(*arguments, **{each.arg: self.value(each.value) for each in node.keywords if each.arg})

    def _function(self, node: ast.expr) -> Callable[..., Any]:
        if isinstance(node, ast.Attribute):
            whole = self.value(node.value)
            kind = next((each for each in METHODS if isinstance(whole, each)), None)
            if kind and node.attr in METHODS[kind] and not isinstance(whole, self._namespace):
                return _method(kind, whole, node.attr)
        function = self.value(node)
        if not any(function is each for each in self._functions):
            raise ExpressionRefused(because("import.xacro.call", function=ast.unparse(node)))
        return function  # type: ignore[no-any-return]  # one of those that were given

    def comprehension(self, node: ast.ListComp | ast.GeneratorExp) -> list[Any]:
        if len(node.generators) != 1:
            raise ExpressionRefused(because("import.xacro.comprehension"))
        (over,) = node.generators
        return [self.value(node.elt) for _ in self._bindings(over)]

    def _bindings(self, over: ast.comprehension) -> Iterator[None]:
        """The names with the comprehension's own, for each element that its conditions take."""
        outer = self._names
        try:
            for element in self.value(over.iter):
                self._names = _Scope(_bound(over.target, element), outer)
                if all(self.value(condition) for condition in over.ifs):
                    yield
        finally:
            self._names = outer


class _Scope(Mapping[str, Any]):
    def __init__(self, own: Mapping[str, Any], outer: Mapping[str, Any]) -> None:
        self._own, self._outer = own, outer

    def __getitem__(self, name: str) -> Any:
        return self._own[name] if name in self._own else self._outer[name]

    def __iter__(self) -> Iterator[str]:
        return iter({**self._own, **self._outer})

    def __len__(self) -> int:
        return len({**self._own, **self._outer})


def _bound(target: ast.expr, element: Any) -> dict[str, Any]:
    if isinstance(target, ast.Name):
        return {target.id: element}
    if isinstance(target, ast.Tuple) and all(isinstance(each, ast.Name) for each in target.elts):
        return {each.id: part for each, part in zip(target.elts, element, strict=True) if isinstance(each, ast.Name)}
    raise ExpressionRefused(because("import.xacro.target"))


def _bounded(value: Any) -> Any:
    """The value itself; raises `ExpressionRefused` where it is larger than any robot's."""
    if isinstance(value, (str, list, tuple, dict, set, frozenset)) and len(value) > LONGEST:
        raise ExpressionRefused(because("import.xacro.value", count=len(value), limit=LONGEST))
    if isinstance(value, int) and value.bit_length() > MOST_BITS:
        raise ExpressionRefused(because("import.xacro.integer", bits=value.bit_length(), limit=MOST_BITS))
    return value


def _power(base: Any, exponent: Any) -> Any:
    if isinstance(base, int) and isinstance(exponent, int) and base.bit_length() * exponent > MOST_BITS:
        raise ExpressionRefused(because("import.xacro.power", limit=MOST_BITS))
    return base**exponent


def _shifted(value: Any, by: Any) -> Any:
    if isinstance(by, int) and by > MOST_BITS:
        raise ExpressionRefused(because("import.xacro.shift", limit=MOST_BITS))
    return value << by


def _product(left: Any, right: Any) -> Any:
    for several, count in ((left, right), (right, left)):
        if isinstance(several, (str, list, tuple)) and isinstance(count, int) and len(several) * count > LONGEST:
            made = str(len(several) * count)  # of any length
            raise ExpressionRefused(because("import.xacro.product", count=made, limit=LONGEST))
    return left * right


def _remainder(left: Any, right: Any) -> Any:
    if isinstance(left, str) and WIDE.search(left):
        raise ExpressionRefused(because("import.xacro.width"))
    return left % right


class _PlainFormat(string.Formatter):
    """`format` of plain data: a field is a number or a name, never an attribute or a subscript."""

    def get_field(self, field_name: str, args: Any, kwargs: Any) -> Any:
        if not re.fullmatch(r"\w*", field_name):
            raise ExpressionRefused(because("import.xacro.field", field=field_name))
        return super().get_field(field_name, args, kwargs)

    def format_field(self, value: Any, format_spec: str) -> str:
        if WIDE.search(format_spec):
            raise ExpressionRefused(because("import.xacro.width"))
        return str(super().format_field(value, format_spec))


def _method(kind: type, whole: Any, name: str) -> Callable[..., Any]:
    """A method of plain data, as its own type has it."""
    if kind is str and name == "format":
        return lambda *arguments, **named: _PlainFormat().vformat(whole, arguments, named)
    if kind is str and name == "replace":
        return lambda old, new, *count: _replaced(whole, old, new, *count)
    return getattr(kind(whole), name)  # type: ignore[no-any-return]  # one of METHODS


def _replaced(whole: str, old: str, new: str, *count: int) -> str:
    if (whole.count(old) + 1) * len(new) > LONGEST:
        raise ExpressionRefused(because("import.xacro.replacement", limit=LONGEST))
    return whole.replace(old, new, *count)


KINDS: Mapping[type[ast.expr], Callable[[_Evaluation, Any], Any]] = {
    ast.Constant: _Evaluation.constant,
    ast.Name: _Evaluation.name,
    ast.BinOp: _Evaluation.binary,
    ast.UnaryOp: _Evaluation.unary,
    ast.BoolOp: _Evaluation.boolean,
    ast.Compare: _Evaluation.comparison,
    ast.IfExp: _Evaluation.choice,
    ast.List: _Evaluation.listed,
    ast.Tuple: _Evaluation.listed,
    ast.Set: _Evaluation.listed,
    ast.Dict: _Evaluation.mapped,
    ast.Subscript: _Evaluation.subscript,
    ast.Attribute: _Evaluation.attribute,
    ast.Call: _Evaluation.call,
    ast.ListComp: _Evaluation.comprehension,
    ast.GeneratorExp: _Evaluation.comprehension,
}
OPERATIONS: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: _product,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: _remainder,
    ast.Pow: _power,
    ast.LShift: _shifted,
    ast.RShift: operator.rshift,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.BitXor: operator.xor,
}
UNARY: Mapping[type[ast.unaryop], Callable[[Any], Any]] = {
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Not: operator.not_,
    ast.Invert: operator.invert,
}
COMPARISONS: Mapping[type[ast.cmpop], Callable[[Any, Any], bool]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Is: operator.is_,
    ast.IsNot: operator.is_not,
    ast.In: lambda part, whole: part in whole,
    ast.NotIn: lambda part, whole: part not in whole,
}
