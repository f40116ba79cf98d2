"""The pages that lead through the first hour: every word that they name is on the page, and every step does it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser

import gemelo
from gemelo.services.panel.words.words import LANGUAGES
from gemelo.tools.stack.stack import Stack
from tests.panel.person import Person, until
from tests.panel.test_page import is_moving, rests
from tests.stacks.browser import SIZE

DOCS = Path(__file__).parents[2] / "docs"
PAGES = {"en": DOCS / "first_hour.md", "es": DOCS / "es" / "primera_hora.md"}
LOCALES = {"en": "en-GB", "es": "es-ES"}
POSTS = {"en": "post", "es": "poste"}
POINTS = {"en": ("One", "Two", "Three"), "es": ("Uno", "Dos", "Tres")}
NAMED = re.compile(r"(?<!\*)\*{1,2}([^*\n]+?)\*{1,2}(?!\*)")
SENTENCES = ("The red button and the space bar stop the arm", "El botón rojo y la barra espaciadora paran el brazo")


@pytest.mark.parametrize("language", PAGES)
def test_every_word_that_it_names_is_on_the_page(language: str) -> None:
    named = [each for each in NAMED.findall(PAGES[language].read_text().replace("\n", " ")) if each not in SENTENCES]
    words = LANGUAGES[language].table.values()
    assert len(named) > 25
    assert [each for each in named if not any(text.startswith(each) for text in words)] == []


class Newcomer(Person):
    """Somebody who has just typed `make up`, and reads one of the two languages."""

    def __init__(self, browser: Browser, port: str, language: str) -> None:
        super().__init__(browser, port, LOCALES[language], SIZE)
        self.post, self.points = POSTS[language], POINTS[language]
        self._table = LANGUAGES[language].table

    def words(self, key: str) -> str:
        """The text of the page in that language, up to a figure that closes it."""
        return self._table[key].partition(": {")[0]


def test_the_first_hour_goes_as_it_is_told(twin: Stack, chromium: Browser) -> None:
    walk("en", twin, chromium)


def walk(language: str, twin: Stack, chromium: Browser) -> None:
    """All that the page of that language tells, on a twin that was just started."""
    twin.wait_ready(120.0)
    port = twin.deployment["GEMELO_PANEL_PORT"]
    with Newcomer(chromium, port, language) as person, gemelo.connect(timeout=60.0) as arm:
        switches_on(person, arm)
        moves(person, arm)
        jogs(person, arm)
        puts_something_in_the_way(person, arm)
        teaches(person, arm, Path(twin.deployment["GEMELO_PATHS_PROGRAMS"]))
        breaks_it(person, arm)
        person.require_no_errors()


def switches_on(person: Newcomer, arm: gemelo.Arm) -> None:
    person.reads(person.words("mode_idle"))
    person.tab(person.words("tab_device"))
    person.press(person.words("disarm"))
    until(lambda: not arm.device.state.armed, bool)
    declares(person, arm)


def declares(person: Newcomer, arm: gemelo.Arm) -> None:
    person.press(person.words("arm"))
    until(lambda: arm.device.state.armed, bool)
    person.press(person.words("reference"))
    person.press(person.words("reference_yes"))
    person.reads(person.words("mode_idle"))


def moves(person: Newcomer, arm: gemelo.Arm) -> None:
    person.tab(person.words("tab_move"))
    person.types("brazo_joint [°]", 30)
    person.press(person.words("plan"))
    person.reads(person.words("duration"))
    assert not is_moving(arm)
    person.press(person.words("execute"))
    until(lambda: arm.joints["brazo_joint"], lambda at: abs(at - 0.5236) < 1e-3)
    person.reads(person.words("ended_succeeded"))
    assert arm.joints["brazo_joint"] == pytest.approx(0.5236, abs=1e-3)
    person.types("brazo_joint [°]", -150)
    person.press(person.words("plan_and_execute"))
    until(lambda: is_moving(arm), bool)
    person.page.keyboard.press("Space")
    rests(arm)
    person.reads(person.words("check_ended"))


def jogs(person: Newcomer, arm: gemelo.Arm) -> None:
    person.tab(person.words("tab_jog"))
    before = arm.joints["brazo_joint"]
    person.button("brazo_joint +").hover()
    person.page.mouse.down()
    until(lambda: is_moving(arm), bool)
    person.page.mouse.up()
    rests(arm)
    assert arm.joints["brazo_joint"] > before


def puts_something_in_the_way(person: Newcomer, arm: gemelo.Arm) -> None:
    arm.move(named="home")
    person.tab(person.words("tab_scene"))
    person.types(person.words("name"), person.post)
    for label, numbers in ((person.words("size_mm"), (40, 40, 160)), (person.words("at_mm"), (290, 270, 80))):
        for place, number in enumerate(numbers):
            field = person.row(label).locator("input").filter(visible=True).nth(place)
            field.fill(str(number))
            field.press("Enter")
    person.press(person.words("add"))
    until(lambda: person.post in arm.scene.objects, bool)
    person.tab(person.words("tab_move"))
    person.chooses(person.words("named_state"), "left")
    person.press(person.words("plan"))
    person.reads(person.words("duration"))
    person.press(person.words("execute"))
    until(lambda: arm.joints["brazo_joint"], lambda at: abs(at - arm.states["left"]["brazo_joint"]) < 1e-3)
    rests(arm)


def teaches(person: Newcomer, arm: gemelo.Arm, folder: Path) -> None:
    person.tab(person.words("tab_teach"))
    for name in person.points:
        arm.move(joints={"brazo_joint": arm.joints["brazo_joint"] - 0.1})
        person.types(person.words("name"), name)
        person.press(person.words("remember"))
        until(lambda name=name: f'"{name}"' in text_of(folder) or f".{name}]" in text_of(folder), bool)
    person.tab(person.words("tab_programs"))
    for name in person.points:
        person.chooses(person.words("target"), name)
        person.press(person.words("add_step"))
        person.reads(f"{person.words('step_go')} {name}")
    person.press(person.words("check"))
    person.reads(person.words("check_ok"))
    person.press(person.words("run_from"))
    person.reads(person.words("run_done"))


def breaks_it(person: Newcomer, arm: gemelo.Arm) -> None:
    person.tab(person.words("tab_device"))
    person.page.get_by_text(person.words("virtual")).filter(visible=True).first.click()
    motion = arm.start(named="home", speed=0.02)  # a minute, of which the page gets what it needs
    until(lambda: is_moving(arm), bool)
    person.press(person.words("estop_press"))
    with pytest.raises(gemelo.Aborted):
        motion.wait()
    person.reads(person.words("mode_estop"))
    person.press(person.words("estop_release"))
    person.press(person.words("reset"))
    declares(person, arm)
    before = steps_away(person)
    person.tab(person.words("tab_device"))
    person.press(person.words("slip").format(joint="brazo_joint"))
    until(lambda: steps_away(person), lambda away: away == before + 10)
    assert arm.step_errors["brazo_joint"] == 0.0


def steps_away(person: Newcomer) -> int:
    """By how many steps the first joint's shaft is not where its counter says."""
    person.tab(person.words("tab_state"))
    rows = person.page.locator("table").filter(has_text=person.words("shaft"), visible=True).locator("tr")
    _, _, executed, shaft = rows.filter(has_text="brazo_joint").first.locator("td").all_inner_texts()
    return int(shaft) - int(executed)


def text_of(folder: Path) -> str:
    return "\n".join(file.read_text() for file in folder.glob("*.points.toml"))
