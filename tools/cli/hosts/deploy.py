"""`gemelo deploy`: a site of several hosts: whether it is sound, what each host needs, and its certificates."""

from __future__ import annotations

import shlex
import time
from pathlib import Path
from typing import TYPE_CHECKING

from gemelo.libraries.runtime.deployment import DEFAULT_FILE, load_deployment, project_root
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.reasons import because
from gemelo.schemas.site import Site
from gemelo.tools.cli.common.errors import CommandError, ExitCode, unknown
from gemelo.tools.cli.common.language import columns, sentence, word
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.parser import Options, Parser, positive_number

if TYPE_CHECKING:
    from gemelo.tools.hosts.certificates import Certificate

FOLDER = "deploy/hosts"


def site_option(parser: Parser) -> None:
    """Adds the site."""
    parser.add_argument("site", metavar="SITE", help=f"a file of {FOLDER} by its name, or any by its path")


def render_options(parser: Parser) -> None:
    """Adds the site and its hosts."""
    site_option(parser)
    parser.add_argument("hosts", nargs="*", metavar="HOST", help="of the site [all]")


def keys_options(parser: Parser) -> None:
    """Adds the site and the time of renewal."""
    site_option(parser)
    parser.add_argument(
        "--renew-within", type=positive_number, default=30.0, metavar="DAYS",
        help="renew what ends within this time [30]; a number above the certificates' own life renews all",
    )  # fmt: skip
    change = parser.add_mutually_exclusive_group()
    change.add_argument(
        "--renew-authority", action="store_true",
        help="make another authority, and all certificates anew; hosts that have not got theirs yet are still believed",
    )  # fmt: skip
    change.add_argument(
        "--retire-authority", action="store_true",
        help="trust the former authority no more: when every host has what --renew-authority has made",
    )  # fmt: skip


def install_options(parser: Parser) -> None:
    """Adds the site, one host, and whether to show only."""
    site_option(parser)
    parser.add_argument("host", metavar="HOST", help="of the site")
    parser.add_argument("--dry-run", action="store_true", help="show the commands, and run none")


def run_check(options: Options) -> ExitCode:
    """Says what runs where and how long certificates last, or everything that is wrong, with lines."""
    from gemelo.tools.hosts.certificates import authority_told, days_by_host, endings, renewal  # slow to load
    from gemelo.tools.hosts.layout import extras, processes

    site = site_named(options.site)
    made = made_here(site)
    days = days_by_host(made)
    rows = []
    for name, host in site.hosts.items():
        running = ", ".join(process.unit.removeprefix("gemelo-") for process in processes(site, name))
        needed = f'EXTRAS="{" ".join(extras(site, name))}"'
        rows.append(
            (
                name,
                host.address,
                running or "-",
                ", ".join(host.roles) or "-",
                sentence(days[name]) if name in days else "-",
                needed,
            )
        )
    print(table(columns("host", "address", "runs", "people", "certificates", "make setup"), rows))
    near = endings(made)
    try:
        found = (*near, *((renewal(site),) if near else ()), *authority_told(site, site_folder(site)))
        print("\n".join(map(sentence, found)))
    except ConfigurationError as error:
        raise CommandError(error) from error
    return ExitCode.OK


def run_render(options: Options) -> ExitCode:
    """Writes the files of some hosts below out/."""
    from gemelo.tools.hosts.render import write  # slow to load

    site = site_named(options.site)
    for host in options.hosts:
        if host not in site.hosts:
            raise unknown("host", host, site.hosts)
    for host in options.hosts or site.hosts:
        folder = site_folder(site) / host
        try:
            files = ", ".join(str(file.relative_to(folder)) for file in write(site, host, folder))
        except OSError as error:
            raise _unwritten(error) from error
        print(f"{said_folder(site, host)}: {files}")
    print(sentence(because("site.rendered", folder=site.config)))
    return ExitCode.OK


def run_keys(options: Options) -> ExitCode:
    """Makes and renews certificates and passwords below out/."""
    from gemelo.tools.hosts.certificates import authority_told  # slow to load: cryptography comes with it
    from gemelo.tools.hosts.keys import authority_in, make_keys

    site = site_named(options.site)
    try:
        if options.renew_authority:
            authority_in(site_folder(site)).renew()
        if options.retire_authority:
            authority_in(site_folder(site)).retire()
        made = make_keys(site, site_folder(site), project_root(), options.renew_within)
    except OSError as error:
        raise _unwritten(error) from error
    except ConfigurationError as error:
        raise CommandError(error) from error
    rows = [
        (
            each.host,
            each.name,
            time.strftime("%Y-%m-%d", time.gmtime(each.expires)),
            word("key", "new" if each.is_new else "kept"),
        )
        for each in made
    ]
    print(table((*columns("host", "certificate of", "valid until"), ""), rows))
    print(sentence(because("site.keys.made", folder=str(said_folder(site)))))
    print("\n".join(map(sentence, authority_told(site, site_folder(site)))))
    return ExitCode.OK


def run_install(options: Options) -> ExitCode:
    """Gives a host its folder over ssh, and starts what does not run there yet."""
    from gemelo.tools.hosts import install  # slow to load, as is all of gemelo.tools.hosts
    from gemelo.tools.hosts.render import outdated

    site = site_named(options.site)
    if options.host not in site.hosts:
        raise unknown("host", options.host, site.hosts)
    try:
        commands = install.commands(site, options.host, site_folder(site) / options.host)
        if old := outdated(site, options.host, site_folder(site) / options.host):
            file = said_folder(site, options.host) / old
            raise CommandError(because("site.install.outdated", file=str(file), site=str(options.site)))
        for command in commands:
            print(shlex.join(command), flush=True)
        if not options.dry_run:
            install.run(commands)
            print(sentence(because("site.install.running")))
    except ConfigurationError as error:
        raise CommandError(error) from error
    return ExitCode.OK


def _date(at: float) -> str:
    return time.strftime("%Y-%m-%d", time.gmtime(at))


def _unwritten(error: OSError) -> CommandError:
    return CommandError(because("cli.file.unwritable", file=str(error.filename), error=str(error.strerror)))


def site_named(name: str) -> Site:
    """The site of that name or file, checked; raises `CommandError`."""
    from gemelo.tools.hosts.checks import load_site  # slow to load: it reads robots

    root = project_root()
    file = Path(name) if name.endswith(".toml") else root / FOLDER / f"{name}.toml"
    try:
        return load_site(file, root)
    except ConfigurationError as error:
        raise CommandError(error) from error


def made_here(site: Site) -> tuple[Certificate, ...]:
    """The certificates of the site made here, if they may be read; raises `CommandError` for a file that is none."""
    from gemelo.tools.hosts.certificates import made  # slow to load

    try:
        return made(site, site_folder(site))
    except ConfigurationError as error:
        raise CommandError(error) from error


def site_folder(site: Site) -> Path:
    """Where the files and keys of a site are made on this machine, whichever deployment its user works with."""
    return Path(load_deployment(project_root() / DEFAULT_FILE).paths.out) / "deploy" / site.name


def said_folder(site: Site, host: str = "") -> Path:
    """As `site_folder`, or that of a host in it, short where it is below the project."""
    folder, root = site_folder(site) / host, project_root()
    return folder.relative_to(root) if folder.is_relative_to(root) else folder
