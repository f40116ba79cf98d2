"""The pages before they are a site: short first ones, two languages, all in the navigation, every link there."""

from __future__ import annotations

import re
import runpy
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from types import SimpleNamespace

import pytest
import yaml
from PIL import Image

import gemelo
from gemelo.schemas.reasons.catalogue import codes, explanation
from tests.gemelo.public import own_names

ROOT = Path(__file__).parents[2]
FIRST = {"en": "README.md", "es": "README.es.md"}
CONFIG = {"en": "mkdocs.yml", "es": "mkdocs.es.yml"}
DIRECTIVE = re.compile(r"^::: gemelo\.(\w+)$", re.MULTILINE)
make_site = SimpleNamespace(**runpy.run_path(str(ROOT / "docs/make_site.py")))


@pytest.fixture(scope="module")
def laid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of both languages' pages; a link to what is not there raises BrokenLink."""
    out = tmp_path_factory.mktemp("site")
    make_site.Site(ROOT, out).lay_out()
    return out


def in_navigation(entries: object) -> Iterator[str]:
    """The pages that it names, at any depth."""
    if isinstance(entries, str):
        yield entries
    for entry in entries.values() if isinstance(entries, dict) else entries if isinstance(entries, list) else ():
        yield from in_navigation(entry)


def navigation(language: str) -> list[dict[str, object]]:
    return list(yaml.safe_load((ROOT / CONFIG[language]).read_text(encoding="utf-8"))["nav"])


@pytest.mark.parametrize("language", FIRST)
def test_every_page_is_in_the_navigation_once_and_nothing_else_is(laid: Path, language: str) -> None:
    pages = {page.relative_to(laid / language).as_posix() for page in (laid / language).rglob("*.md")}
    own = {page for page in pages if not page.startswith("source/")}
    named = list(in_navigation(navigation(language)))
    assert sorted(named) == sorted(own)


def test_both_languages_have_the_same_sections() -> None:
    english, spanish = (len(navigation(language)) for language in FIRST)
    assert english == spanish == 9


def test_every_spanish_page_has_an_english_one_that_leads_back(laid: Path) -> None:
    def counterpart(page: Path) -> Path | None:
        found = re.search(r"^counterpart: (\S+)\.html$", page.read_text(encoding="utf-8"), re.MULTILINE)
        return (page.parent / f"{found[1]}.md").resolve() if found else None

    spanish = sorted((laid / "es").rglob("*.md"))
    assert len(spanish) > 15
    lonely = []
    for page in spanish:
        english = counterpart(page)
        if page.name != "referencia.md" and (english is None or counterpart(english) != page.resolve()):
            lonely.append(page.name)
    assert lonely == []


def test_a_link_to_what_is_not_there_is_refused_with_its_page(tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("[gone](docs/gone.md)\n")
    (tmp_path / "README.es.md").write_text("\n")
    with pytest.raises(make_site.BrokenLink, match=r"README\.md links to docs/gone\.md, and there is no docs/gone\.md"):
        make_site.Site(tmp_path, tmp_path / "out").lay_out()


def test_what_looks_like_a_link_in_code_is_none(tmp_path: Path) -> None:
    text = "```\n[no](gone.md)\n```\n"
    (tmp_path / "README.md").write_text(text)
    (tmp_path / "README.es.md").write_text("\n")
    make_site.Site(tmp_path, tmp_path / "out").lay_out()
    assert text in (tmp_path / "out/en/index.md").read_text()


@pytest.mark.parametrize(
    ("path", "page"),
    [
        ("README.es.md", "es/index.md"),
        ("docs/es/ojos.md", "es/ojos.md"),
        ("docs/inside/stops.md", "en/inside/stops.md"),
        ("firmware/README.md", "en/firmware/index.md"),
        ("schemas/topics.py", "en/source/schemas/topics.py.md"),
    ],
)
def test_where_a_page_stands(path: str, page: str) -> None:
    assert make_site.page_of(PurePosixPath(path)) == PurePosixPath(page)


@pytest.mark.parametrize("language", FIRST)
def test_the_first_page_is_short_and_shows_a_moving_picture(language: str) -> None:
    lines = (ROOT / FIRST[language]).read_text(encoding="utf-8").splitlines()
    assert len(lines) < 120
    [picture] = [found[1] for line in lines[:5] if (found := re.match(r"!\[.+\]\((.+\.gif)\)$", line))]
    assert (ROOT / picture).stat().st_size < 2e6
    with Image.open(ROOT / picture) as moving:
        assert getattr(moving, "n_frames", 1) > 20


def test_both_first_pages_lead_to_the_same() -> None:
    english, spanish = ((ROOT / name).read_text(encoding="utf-8") for name in FIRST.values())
    assert english.count("\n| ") == spanish.count("\n| ") > 18
    commands = [re.findall(r"^(make \w+) +#", text, re.MULTILINE) for text in (english, spanish)]
    assert commands[0] == commands[1]
    assert len(commands[0]) == 2


def test_every_public_name_has_its_place_in_the_api_pages_once() -> None:
    named = [name for page in sorted((ROOT / "docs/api").glob("*.md")) for name in DIRECTIVE.findall(page.read_text())]
    assert sorted(named) == sorted(own_names())
    assert [name for name in named if not hasattr(gemelo, name)] == []


@pytest.mark.parametrize("language", FIRST)
def test_the_page_of_reasons_has_every_code_with_what_it_means_and_an_example(laid: Path, language: str) -> None:
    make_reasons = SimpleNamespace(**runpy.run_path(str(ROOT / "docs/make_reasons.py")))
    make_reasons.main(laid)
    text = (laid / make_reasons.PAGES[language]).read_text(encoding="utf-8")
    assert [code for code in codes() if f"| `{code}` | " not in text] == []
    assert explanation("goal.limit.position", language) in text
    assert make_reasons.MARK not in text
