"""`gemelo deploy status`: every service of a site as the bus has it, from a person's host with its certificate."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import msgspec

import gemelo
from gemelo.libraries.credentials.expiry import expiry
from gemelo.libraries.runtime.clock_offset import ClockOffset
from gemelo.libraries.runtime.errors import BusError, NoAnswer, RequestRefused
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.node_clock import ask_about
from gemelo.libraries.runtime.started import load_started
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.roles import ROLE_OF_NODE
from gemelo.schemas.site import Site
from gemelo.schemas.topics import DEVICE_STATUS
from gemelo.tools.cli.bus.node import is_command
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage
from gemelo.tools.cli.common.language import columns, reason_or, sentence, word
from gemelo.tools.cli.common.session import own_name, require_router
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.hosts.deploy import made_here, said_folder, site_named, site_option
from gemelo.tools.cli.parser import Options, Parser, json_option
from gemelo.tools.hosts.certificates import Certificate, days_by_host, endings, in_days, older, renewal, shown_at
from gemelo.tools.hosts.layout import BROKER, ROUTER
from gemelo.tools.hosts.status import SeenNode, SeenRobot, ServiceState, ServiceStatus, is_well, site_status

HEADINGS = ("host", "robot", "service", "is", "machine", "version", "clock", "certificate", "why")
TO_ANSWER = 2.0  # [s] of one node
TO_TELL = 1.0  # [s] until what is latched has come


def status_options(parser: Parser) -> None:
    """Adds the site and --json."""
    site_option(parser)
    json_option(parser)


def run(options: Options) -> ExitCode:
    """Prints every service; FAILED if one of them is not ready, or should not be there."""
    site = site_named(options.site)
    deployment = _deployment(site)
    require_router(deployment)
    names = dict.fromkeys((*site.robots, *gemelo.robots(deployment)))
    seen = {name: seen_robot(deployment, name) for name in names}
    found = site_status(site, seen, shown_certificates(site, deployment))
    if options.json:
        print(msgspec.json.encode(found).decode())
    else:
        print(table(columns(*HEADINGS), [_row(each) for each in found]))
        print(summary(found))
        for each in certificates_told(site, found, deployment):
            print(sentence(each))
    return ExitCode.OK if is_well(found) else ExitCode.FAILED


def summary(found: Iterable[ServiceStatus]) -> str:
    """One sentence about all, and one where hosts have different versions."""
    rows = tuple(found)
    wrong = [
        because(
            "site.status.is_not", service=each.service, of=each.robot or word("site", "site"), standing=each.standing
        )
        for each in rows
        if each.standing is not ServiceState.READY
    ]
    lines = ["; ".join(map(sentence, wrong)) if wrong else sentence(because("site.status.all", count=len(rows)))]
    versions = {each.version: each for each in rows if each.version}
    if len(versions) > 1:
        differ = [
            sentence(because("site.status.version", version=version, service=each.service, machine=each.machine))
            for version, each in sorted(versions.items())
        ]
        lines.append(sentence(because("site.status.versions", versions=", ".join(differ))))
    return "\n".join(lines)


def shown_certificates(site: Site, deployment: Deployment) -> dict[str, float | None]:
    """[s] UNIX time at which the certificates end that router and broker show now."""
    own = deployment.router
    if not own.tls:
        return {}
    return {
        ROUTER: shown_at(own.host, own.port, own.certificate, own.key),
        BROKER: shown_at(site.hosts[site.broker.host].address, site.broker.port),
    }


def certificates_told(site: Site, found: Iterable[ServiceStatus], deployment: Deployment) -> Iterator[Reason]:
    """How many days each host's certificates still have; those that end within a month, have ended, or are old."""
    if not deployment.router.tls:
        return
    rows = [each for each in found if each.host]
    running = dict.fromkeys(
        Certificate(each.host, ROLE_OF_NODE.get(each.service, each.service), each.certificate_ends)
        for each in rows if each.certificate_ends is not None
    )  # fmt: skip
    own = Path(deployment.router.certificate)
    days = days_by_host(running)
    unknown = because("site.days.unknown")
    told = ", ".join(f"{host} {sentence(days.get(host, unknown))}" for host in site.hosts)
    yield because("site.certificates", in_days(expiry(own)), hosts=told)
    silent = {each.host for each in rows if each.standing is ServiceState.SILENT}
    here = made_here(site)
    near = [*endings((*running, Certificate(word("site", "this host"), own.stem, expiry(own))))]
    by_file = endings(each for each in here if each.host in silent)
    near += [because("site.certificate.by_file", each, folder=str(said_folder(site))) for each in by_file]
    yield from (*near, renewal(site)) if near else ()
    yield from older(running, here)


def seen_robot(deployment: Deployment, robot: str) -> SeenRobot:
    """Who is alive of a robot, what each says of itself, and what its gateway says of the device."""
    try:
        with Node(own_name(), deployment, robot=robot, log_level="error") as node:
            device = node.latest(DEVICE_STATUS)
            nodes = seen_nodes(node)
            if "stepper_gateway" in nodes:
                end = node.monotonic() + TO_TELL
                while device.message is None and node.monotonic() < end:
                    node.wait(0.05)
            return SeenRobot(nodes, device.message if "stepper_gateway" in nodes else None)
    except BusError as error:
        raise CommandError(error, ExitCode.NO_STACK) from error


def seen_nodes(node: Node) -> dict[str, SeenNode]:
    """Every living node but commands', each asked about itself and its clock."""
    found = {}
    for name in sorted(each for each in node.alive() if not is_command(each)):
        try:
            found[name] = SeenNode(*ask_about(node, name, TO_ANSWER))
        except (NoAnswer, RequestRefused):
            found[name] = SeenNode()
    return found


def _deployment(site: Site) -> Deployment:
    """The person's own, which must be for the site's router."""
    try:
        deployment = load_started()
    except ConfigurationError as error:
        raise usage(error) from error
    own, wanted = deployment.router, site.hosts[site.router.host]
    if (own.host, own.port) != (wanted.address, site.router.port):
        raise usage(
            because(
                "site.status.other_router",
                site=site.name,
                wanted=f"{wanted.address}:{site.router.port}",
                own=f"{own.host}:{own.port}",
                file=f"{site.config}/{next(iter(site.robots), 'rm1')}.toml",
            )
        )
    return deployment


def _row(each: ServiceStatus) -> tuple[str, ...]:
    clock = "-" if each.clock_offset is None else str(ClockOffset(each.clock_offset, each.clock_bound))
    certificate = "-" if each.certificate_ends is None else sentence(in_days(each.certificate_ends))
    return (
        each.host or "-", each.robot or "-", each.service, word("standing", each.standing), each.machine or "-",
        each.version or "-", clock, certificate, reason_or(each.why, each.reason) or "-",
    )  # fmt: skip
