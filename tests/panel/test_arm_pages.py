"""The page of one arm among several says which one it is, and leads to the others from wherever it was opened."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
import viser
from playwright.sync_api import Browser, expect

from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.deployment import Deployment, PanelSection, PathsSection
from gemelo.services.panel.view.arm_pages import ArmPage, arm_pages, arms_line
from gemelo.services.panel.words.words import Words
from gemelo.tools.stack.arms import stacked_arms
from gemelo.tools.stack.several_arms import write
from gemelo.tools.stack.stack import free_ports
from tests.stacks.browser import new_context

ENGLISH = Words("en")


def test_arms_that_are_started_together_know_one_anothers_pages_and_one_alone_has_no_line(tmp_path):
    common = Deployment(paths=PathsSection(run=str(tmp_path), out=str(tmp_path)), panel=PanelSection(port=8100))
    assert arms_line(arm_pages(common), "rm1", ENGLISH) == ""
    arms = stacked_arms(("rm1", "parol6"), common, project_root())
    write(arms, common, project_root(), {})
    wanted = (ArmPage("rm1", "127.0.0.1", 8100), ArmPage("parol6", "127.0.0.1", 8101))
    assert all(arm_pages(each.deployment) == wanted for each in arms)


def test_a_name_with_html_in_it_is_text():
    pages = (ArmPage("<i>", "h", 1), ArmPage('"onclick=', "h", 2))
    shown = arms_line(pages, "<i>", Words("es"))
    assert "<b>&lt;i&gt;</b>" in shown
    assert "Brazos" in shown
    assert '"onclick=' not in shown


@pytest.fixture
def both() -> Iterator[tuple[ArmPage, ...]]:
    """Two pages with nothing but their line of arms."""
    pages = tuple(ArmPage(name, "127.0.0.1", port) for name, port in zip(("rm1", "parol6"), free_ports(2), strict=True))
    servers = [viser.ViserServer(page.host, page.port, verbose=False) for page in pages]
    for server, page in zip(servers, pages, strict=True):
        server.gui.add_html(arms_line(pages, page.robot, ENGLISH))
    yield pages
    for server in servers:
        server.stop()


def test_a_click_leads_to_the_other_arms_page_by_the_name_by_which_this_one_was_opened(
    both: tuple[ArmPage, ...], chromium: Browser
) -> None:
    context = new_context(chromium)
    try:
        page = context.new_page()
        page.goto(f"http://localhost:{both[0].port}")
        page.get_by_role("link", name="parol6", exact=True).click()
        expect(page).to_have_url(re.compile(f"^http://localhost:{both[1].port}/"), timeout=60_000.0)
        page.get_by_role("link", name="rm1", exact=True).wait_for()
    finally:
        context.close()
