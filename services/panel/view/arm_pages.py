"""The line that names the page's arm among several on this machine, with the way to the pages of the others."""

from __future__ import annotations

from dataclasses import dataclass

from gemelo.libraries.runtime.deployment import deployments_beside, robot_name
from gemelo.schemas.deployment import Deployment
from gemelo.services.panel.view.kit import esc
from gemelo.services.panel.words.words import Words

# By the name that this page was opened with: through a tunnel that is not the one which the other listens on.
THERE = "this.hostname = location.hostname"


@dataclass(frozen=True)
class ArmPage:
    """Where an arm's page is."""

    robot: str
    host: str
    port: int


def arm_pages(deployment: Deployment) -> tuple[ArmPage, ...]:
    """Of all arms that were started together, this one among them; empty where it was started alone."""
    beside = deployments_beside(deployment)
    return tuple(ArmPage(robot_name(each), each.panel.host, each.panel.port) for each in beside)


def arms_line(pages: tuple[ArmPage, ...], own: str, words: Words) -> str:
    """HTML: every arm, the page's own in bold, the others as links; nothing where there is only one."""
    if len(pages) < 2:
        return ""
    names = " · ".join(f"<b>{esc(own)}</b>" if page.robot == own else _link(page) for page in pages)
    return f'<div style="margin:0 0.9em 0.5em;font-size:0.9em">{esc(words("arms"))}: {names}</div>'


def _link(page: ArmPage) -> str:
    address = esc(f"http://{page.host}:{page.port}")
    return f'<a href="{address}" onclick="{THERE}" style="color:inherit">{esc(page.robot)}</a>'
