"""A language: one file with the page's words, one row of the table of languages, and a folder of the catalogue."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.additions import ROOT, added, row_added, run_in

PORTUGUESE = '''"""The page in Portuguese."""

from gemelo.services.panel.words.en import ENGLISH
from gemelo.services.panel.words.language import Language

LANGUAGE = Language(
    "Português",
    {**ENGLISH, "plan": "Planejar", "execute": "Executar", "mode_idle": "Em repouso"},
    {"mode": {"IDLE": "em repouso"}},
)
'''
GOAL = """
msgid "goal.limit.position"
msgstr "{joint}: {value:{unit}} passa do limite de {limit:{unit}}"
"""
SCRIPT = """
import json, sys
from pathlib import Path
from gemelo.schemas.reasons import because
from gemelo.services.panel.model.problems import Problem
from gemelo.services.panel.words.words import Words, language_of
from tests.panel.memory_page import memory_page
from tests.runtime.support import until

words = Words(language_of("pt-BR"))
at = because("goal.limit.position", joint="q1", value=1.0, limit=0.5, unit="rad", side="upper")
rejected = words.problem(Problem("refused by stepper_gateway", reason=at))[1]
written = [words("plan"), rejected]
written += [words.value("mode", "IDLE"), words.value("mode", "RUN")]
with memory_page("rm1", Path(sys.argv[1])) as page:
    page.draw(3)
    page.browser.choose("Language / Idioma", "Português")

    def is_portuguese():
        page.draw()
        is_at_rest = any("Em repouso" in text for text in page.browser.texts)
        return is_at_rest and {"Planejar", "Executar"} <= page.browser.labels

    written.append(until(is_portuguese, 60.0))
print(json.dumps(written))
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """This one, with Portuguese."""
    words = "services/panel/words/words.py"
    spanish = next(line for line in (ROOT / words).read_text().splitlines() if line.startswith('    "es": '))
    table = row_added(words, after=spanish, row='    "pt": pt.LANGUAGE,')[words]
    first = "from gemelo.services.panel.words import en, es"
    assert first in table
    table = table.replace(first, f"{first}, pt")
    catalogue = "schemas/reasons/catalogue.py"  # a file of its own, which looks for languages beside it
    languages = "schemas/reasons/languages/"
    files = {"services/panel/words/pt.py": PORTUGUESE, words: table, catalogue: (ROOT / catalogue).read_text()}
    folder = added(tmp_path_factory.mktemp("project"), {**files, f"{languages}beside_the_others": ""})
    sources = tmp_path_factory.mktemp("languages")
    (sources / "pt").mkdir()
    (sources / "pt/goal.po").write_text(GOAL)
    subprocess.run([sys.executable, ROOT / "schemas/reasons/compiled.py", sources], check=True)  # as `make setup` does
    shutil.copytree(sources / "pt", folder / languages / "pt")
    return folder


def test_a_new_language_is_chosen_by_a_browser_and_by_a_person_and_says_what_it_knows(
    project: Path, tmp_path: Path
) -> None:
    (tmp_path / "script.py").write_text(SCRIPT)
    done = run_in(project, str(tmp_path / "script.py"), str(tmp_path))
    assert done.returncode == 0, done.stderr
    *written, is_on_the_page = json.loads(done.stdout.splitlines()[-1])
    rejected = "q1: 57.3° passa do limite de 28.6°."
    assert written == ["Planejar", rejected, "em repouso", "RUN"]
    assert is_on_the_page
