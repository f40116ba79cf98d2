"""The mutations that `tests.house.mutants` draws: the same for a seed, as many of each room, each another program."""

from __future__ import annotations

import ast
from collections import Counter

import pytest

from tests.house.mutants import ROOMS, ROOT, draw, mutated, near


def test_a_seed_draws_the_same_mutations_and_as_many_of_each_room():
    drawn = draw(40, 7)
    assert drawn == draw(40, 7) != draw(40, 8)
    assert Counter(each.room for each in drawn) == dict.fromkeys(ROOMS, 10)


def test_each_mutation_changes_its_line_alone_and_leaves_a_program():
    for mutation in draw(80, 7):
        before = (ROOT / mutation.path).read_text()
        after = mutated(before, mutation)
        lines = zip(before.splitlines(), after.splitlines(), strict=True)
        changed = [number for number, (old, new) in enumerate(lines, 1) if old != new]
        assert changed == [mutation.line]
        if mutation.path.endswith(".py"):
            assert ast.dump(ast.parse(before)) != ast.dump(ast.parse(after))


def test_a_mutation_of_another_text_is_refused():
    [mutation] = draw(1, 7)
    with pytest.raises(ValueError, match=r"does not stand there"):
        mutated("", mutation)


def test_the_tests_that_name_a_module_run_first():
    [mutation] = [each for each in draw(400, 7) if each.path == "libraries/runtime/client_watch.py"][:1]
    assert "tests/runtime/test_client_watch.py" in near(mutation)
