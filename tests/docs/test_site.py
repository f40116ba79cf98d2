"""`make docs` as it is read: built without network, every link and picture there, nothing fetched from elsewhere."""

from __future__ import annotations

import json
import os
import re
import subprocess
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from playwright.sync_api import Browser, expect

from tests.optional import need_site
from tests.stacks.browser import PATIENCE, new_context

pytestmark = pytest.mark.full

ROOT = Path(__file__).parents[2]
NOWHERE = {"HTTP_PROXY": "http://127.0.0.1:9", "HTTPS_PROXY": "http://127.0.0.1:9", "UV_OFFLINE": "1"}
LOADED = {("script", "src"), ("img", "src"), ("link", "href"), ("iframe", "src"), ("source", "src")}
FOR_MACHINES = {"canonical", "prev", "next"}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Both languages, built strictly: a warning of mkdocs ends it."""
    need_site()
    out = tmp_path_factory.mktemp("docs") / "site"
    done = subprocess.run(
        [ROOT / "deploy/docs", out],
        env=os.environ | NOWHERE,
        capture_output=True,
        text=True,
        timeout=300.0,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return out


@dataclass
class Read(HTMLParser):
    """What a page defines and what it needs."""

    ids: set[str] = field(default_factory=set)
    links: set[str] = field(default_factory=set)
    loaded: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.ids.add(values.get("id", ""))
        if tag == "a":
            self.links.add(values.get("href", ""))
        if tag == "link" and values.get("rel") in FOR_MACHINES:
            return
        self.loaded |= {values[name] for each, name in LOADED if each == tag and values.get(name)}


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Read]:
    found = {}
    for page in site.rglob("*.html"):
        found[page] = Read()
        found[page].feed(page.read_text(encoding="utf-8"))
    return found


def target(page: Path, link: str) -> Path:
    path = unquote(urlsplit(link).path)
    return (page.parent / path).resolve() if path else page


def test_every_link_leads_to_a_page_and_a_place_that_are_there(site: Path, pages: dict[Path, Read]) -> None:
    dead = []
    for page, read in pages.items():
        if page.name == "404.html":  # whose links count from the root of a server
            continue
        for link in read.links - {""}:
            if urlsplit(link).scheme:
                continue
            leads = target(page, link)
            fragment = unquote(urlsplit(link).fragment)
            if leads not in pages or (fragment and fragment not in pages[leads].ids):
                dead.append(f"{page.relative_to(site)}: {link}")
    assert len(pages) > 80
    assert dead == []


def test_nothing_is_fetched_from_elsewhere(site: Path, pages: dict[Path, Read]) -> None:
    for page, read in pages.items():
        if page.name != "404.html":
            assert [each for each in read.loaded if urlsplit(each).scheme] == [], page
            assert [each for each in read.loaded if not target(page, each).is_file()] == [], page
    for style in site.rglob("*.css"):
        assert re.findall(r"url\((['\"]?https?:[^)]*)\)", style.read_text(encoding="utf-8")) == [], style


def test_every_page_is_reached_from_the_first_ones(site: Path, pages: dict[Path, Read]) -> None:
    reached: set[Path] = set()
    waiting = [site / "index.html"]
    while waiting:
        page = waiting.pop()
        if page not in reached:
            reached.add(page)
            waiting += [each for link in pages[page].links if (each := target(page, link)) in pages]
    assert [page for page in pages if page not in reached and page.name != "404.html"] == []


def test_an_argument_is_said_with_its_type_and_comment_and_an_example_is_code(site: Path) -> None:
    text = (site / "en/api/arm.html").read_text(encoding="utf-8")
    assert re.search(r"<code>named</code></td>\s*<td><code>str</code></td>\s*<td>a named state of the SRDF", text)
    assert '<span class="gp">&gt;&gt;&gt; </span>' in text
    assert re.search(r'<h3 id="gemelo\.Arm\.move"', text)


@pytest.mark.parametrize("language", ["en", "es"])
def test_no_word_of_the_search_has_an_asterisk_which_would_be_a_pattern(site: Path, language: str) -> None:
    index = json.loads((site / language / "search/search_index.json").read_text(encoding="utf-8"))
    texts = [re.sub(r"<[^>]*>", " ", f"{each['title']} {each['text']}") for each in index["docs"]]
    words = {word for text in texts for word in re.split(index["config"]["separator"], text) if word}
    assert len(words) > 1000
    assert sorted(word for word in words if "*" in word) == []


@pytest.mark.parametrize(("language", "word", "title"), [("en", "gripper", "My gripper"), ("es", "pinza", "Mi pinza")])
def test_the_search_finds_a_page_that_was_opened_from_the_disk(
    site: Path, chromium: Browser, language: str, word: str, title: str
) -> None:
    context = new_context(chromium)
    page = context.new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto((site / language / "index.html").as_uri())
    page.locator("input.md-search__input").focus()
    expect(page.locator(".md-search-result__meta")).to_have_text(re.compile("^(Type|Teclee)"), timeout=PATIENCE)
    page.keyboard.type(word)
    expect(page.locator(".md-search-result__item h1").first).to_have_text(title, timeout=PATIENCE)
    context.close()
    assert [url for url in asked if not url.startswith("file:")] == []


@pytest.mark.parametrize("width", [360, 1280])
@pytest.mark.parametrize("first", ["en/index.html", "es/index.html", "en/api/arm.html", "en/inside/failures.html"])
def test_a_page_is_as_wide_as_its_window(site: Path, chromium: Browser, first: str, width: int) -> None:
    context = new_context(chromium, viewport={"width": width, "height": 720})
    page = context.new_page()
    page.goto((site / first).as_uri())
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    context.close()


def test_the_other_language_is_the_same_page(site: Path, chromium: Browser) -> None:
    context = new_context(chromium)
    page = context.new_page()
    page.goto((site / "en/eyes.html").as_uri())
    page.get_by_role("link", name="Español", exact=True).first.click()
    expect(page.get_by_role("heading", name="Ojos").first).to_be_visible()
    page.get_by_role("link", name="English", exact=True).first.click()
    expect(page.get_by_role("heading", name="Eyes").first).to_be_visible()
    context.close()
