"""The catalogue of reasons against the code: each code that is raised has its sentence in every language."""

from __future__ import annotations

import ast
import string
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from typing import Any

import msgspec
import numpy as np
import polib
import pytest

from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.message import decode, encode
from gemelo.schemas.reasons import FrontEnd, Reason, because, plain, remedy, say
from gemelo.schemas.reasons.catalogue import ENGLISH, EXPLAIN, LANGUAGES, codes, entries, languages
from gemelo.schemas.reasons.examples import example_of, examples
from gemelo.schemas.reasons.sentences import WITHIN

ROOT = project_root()
BEYOND = because(
    "goal.limit.position.at_point",
    because(
        "goal.limit.position",
        remedy("stay_within", lower=-2.95, upper=2.95, unit="rad"),
        joint="brazo_joint", value=3.2, limit=2.95, side="upper", unit="rad",
    ),
    point=3, time=0.2,
)  # fmt: skip


@cache
def catalogue(language: str) -> dict[str, str]:
    """The templates for all front ends, by code."""
    files = sorted((LANGUAGES / language).glob("*.po"))
    return {entry.msgid: entry.msgstr for file in files for entry in polib.pofile(str(file)) if not entry.msgctxt}


def calls() -> Iterator[tuple[str, ast.Call]]:
    """Every call of `because` and `remedy` in the product, with its file."""
    for room in ("services", "libraries", "tools", "gemelo", "schemas", "integrations"):
        for path in (ROOT / room).rglob("*.py"):
            if (text := path.read_text()).find("schemas.reasons") < 0:
                continue
            for node in ast.walk(ast.parse(text)):
                if isinstance(node, ast.Call) and ast.unparse(node.func) in ("because", "remedy"):
                    yield str(path.relative_to(ROOT)), node


def constants() -> set[str]:
    """Every string in the files that make reasons."""
    files = {file for file, _ in calls()}
    nodes = (node for file in files for node in ast.walk(ast.parse((ROOT / file).read_text())))
    return {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}


def places(template: str) -> set[str]:
    """The names of the values in a template, those in a unit too."""
    found = set()
    for _, name, spec, _ in string.Formatter().parse(template):
        found |= ({name} if name else set()) | (places(spec) if spec else set())
    return found


def test_numbers_of_numpy_go_along_as_pythons_own() -> None:
    values: dict[str, Any] = {
        "value": np.float64(1.5), "count": np.int64(3), "is_on": np.bool_(True), "far": np.float64(np.inf),
        "pair": (np.float64(0.25), "rad"), "joints": {"brazo_joint": np.float32(0.5)},
    }  # fmt: skip
    own = {"value": 1.5, "count": 3, "is_on": True, "far": "inf", "pair": (0.25, "rad"), "joints": {"brazo_joint": 0.5}}
    for made in (because("a.code", **values), remedy("a_remedy", **values)):
        assert made.values == own
        assert {type(each) for each in made.values.values()} == {float, int, bool, str, tuple, dict}
        assert msgspec.json.decode(msgspec.json.encode(made.values)) == {**own, "pair": [0.25, "rad"]}


def test_every_code_that_is_raised_is_in_the_catalogue():
    raised = [(file, call.args[0]) for file, call in calls() if call.args]
    assert len(raised) > 40
    literal = {(file, node.value) for file, node in raised if isinstance(node, ast.Constant)}
    assert [each for each in literal if each[1] not in catalogue(ENGLISH)] == []


def test_every_code_of_the_catalogue_is_raised():
    raised = constants()
    assert [code for code in catalogue(ENGLISH) if not code.startswith("word.") and code not in raised] == []


@pytest.mark.parametrize("language", languages())
def test_every_language_has_every_code_with_all_its_values(language: str):
    known, english = catalogue(language), catalogue(ENGLISH)
    assert known.keys() == english.keys()
    assert {code: differ for code in known if (differ := places(known[code]) ^ places(english[code]))} == {}


def test_the_values_at_a_call_are_those_of_its_template():
    """Where both are literal: the rest comes from dictionaries, which the tests of what raises them fill in."""
    for file, call in calls():
        code = call.args[0] if call.args else None
        if isinstance(code, ast.Constant) and all(word.arg for word in call.keywords):
            given = {str(word.arg) for word in call.keywords}
            placed = places(catalogue(ENGLISH)[code.value]) - WITHIN
            assert placed == given, f"{file}: {code.value}"


def test_a_reason_is_said_in_the_language_and_the_terms_of_its_reader():
    assert str(BEYOND) == (
        'joint "brazo_joint": 3.2000 rad is beyond the upper limit 2.9500 rad; stay within -2.9500 rad to 2.9500 rad '
        "at point 3 (0.200 s)"
    )
    assert say(BEYOND, "es", FrontEnd.PAGE) == (
        "brazo_joint: 183.3° está más allá del límite superior de 169.0°; quédese entre -169.0° y 169.0° "
        "(punto 3, a los 0.200 s)"
    )


def test_it_travels():
    assert decode(Reason, encode(BEYOND)) == BEYOND


def test_a_language_without_a_folder_is_english():
    assert say(BEYOND, "de") == str(BEYOND)


def test_a_code_of_a_newer_program_is_given_with_its_values():
    assert str(because("goal.moon.full", phase=0.5)) == "goal.moon.full (phase 0.5)"


def test_a_value_that_an_older_program_does_not_send_is_a_question_mark():
    assert str(because("goal.joints.unknown")) == 'joint "?" is unknown'


def test_a_number_that_is_not_finite_goes_along_as_its_word():
    assert str(because("goal.tolerance.time", value=float("nan"))).startswith("goal_time_tolerance is nan s")


def test_a_sentence_without_a_code_is_itself_in_every_language():
    assert say(plain("the wire is torn"), "es") == "the wire is torn"


def test_several_remedies_are_a_choice():
    both = because("goal.points.none", remedy("plan_again"), remedy("in_parts"))
    assert str(both) == "the trajectory has no points; plan again, or send it in parts"
    assert say(both, "es") == "El plan no tiene puntos; planifique otra vez, o envíelo por partes"


def test_of_many_names_the_first_are_given_and_how_many_more():
    drawn = because("mend.links.drawn", count=5, links=("a", "b", "c", "d", "e"))
    assert str(drawn) == "5 links are drawn and have no <collision> (a, b, c and 2 more)"
    assert say(drawn, "es").endswith(": a, b, c y 2 más (5 en total)")
    three = because("mend.links.drawn", count=3, links=("a", "b", "c"))
    assert str(three).endswith("(a, b, c)")


def test_several_words_are_joined_by_and_and_a_number_among_words_stands_as_it_is():
    units = because("mend.mesh.units", because("mend.mesh.long", mesh="a", length=1.0, span=2.0), units=("cm", "in"))
    assert str(units).endswith(": centimetres and inches fit")
    assert say(units, "es").endswith(": podrían ser centímetros y pulgadas")
    soft = because("mend.soft.same", low=-0.5, high="none")
    assert str(soft) == "its soft limits -0.5 to none are its limits"
    assert "de -0.5 a ninguno" in say(soft, "es")


def test_what_is_explained_is_a_code_or_the_beginning_of_some_in_every_language():
    explained = {
        language: {name for context, name in entries(language) if context == EXPLAIN} for language in languages()
    }
    assert all(names == explained[ENGLISH] for names in explained.values())
    known = codes()
    assert [name for name in explained[ENGLISH] if not any(f"{code}.".startswith(f"{name}.") for code in known)] == []


def test_an_example_is_that_of_a_real_cause_and_has_the_values_of_its_template():
    assert sum(example_of(code) is each for code, each in examples().items()) > 30
    for code in codes():
        assert set(example_of(code).values) == places(catalogue(ENGLISH)[code]) - WITHIN, code


def test_the_index_has_every_template_that_the_files_have():
    for language in languages():
        assert {name for context, name in entries(language) if not context} == set(catalogue(language))


def test_a_value_may_be_quoted_as_python_writes_it():
    assert str(because("program.name.blank", kind="point", name=" P1")).startswith("the point's name ' P1' ")


WITHOUT_DESCRIPTORS = """
import gettext, resource
from gemelo.schemas.reasons import because
soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
resource.setrlimit(resource.RLIMIT_NOFILE, (0, hard))
print(because("goal.joints.unknown", joint="elbow"))
resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
print(because("goal.joints.unknown", joint="elbow"))
"""


def test_a_process_without_a_free_descriptor_says_the_code_and_later_the_sentence():
    done = subprocess.run([sys.executable, "-c", WITHOUT_DESCRIPTORS], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["goal.joints.unknown (joint elbow)", 'joint "elbow" is unknown']
