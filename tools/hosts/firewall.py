"""Limits of new connections to router and broker, for nftables: what each address may open, before anybody reads it.

Zenoh's router pauses 0.1 s after each handshake that fails, and opens 1,000 sessions at most: without limits a laptop
that has no certificate keeps everybody from joining with a dozen connections a second. Connections that are open are
never touched, so whoever is connected may stop the arm. Loopback is not limited.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable, Iterator

from gemelo.schemas.site import Site
from gemelo.tools.hosts.layout import processes

FILE, UNIT_NAME = "gemelo.nft", "gemelo-firewall.service"
# Chosen. All services of a host that come back together, each trying twice a second, find place within some seconds;
# strangers, whatever their number, leave the router most of its time.
OF_A_HOST = "limit rate over 20/second burst 100 packets"
OF_A_STRANGER = "limit rate over 2/second burst 20 packets"
OF_ALL_STRANGERS = "limit rate over 6/second burst 30 packets"
OPEN_OF_A_HOST, OPEN_OF_A_STRANGER = 256, 32  # connections at a time

TABLE = """\
# Written by `gemelo deploy render {site} {host}`: `nft -f` loads it, in place of what it was before.
table inet gemelo
delete table inet gemelo
table inet gemelo {{
{sets}
	chain input {{
		type filter hook input priority filter - 10; policy accept;
		iifname "lo" accept
		tcp dport {{ {ports} }} ct state new jump joining
	}}
	chain joining {{
		ip saddr @hosts4 goto host4
		ip6 saddr @hosts6 goto host6
		meta nfproto ipv4 jump stranger4
		meta nfproto ipv6 jump stranger6
		{all_strangers} counter drop
	}}
{chains}
}}
"""
SET = """\
	set {name} {{
		type {kind}
		{what}
	}}"""
CHAIN = """\
	chain {who}{family} {{
		add @{who}_open{family} {{ {saddr} saddr ct count over {most} }} counter reject with tcp reset
		update @{who}_rate{family} {{ {saddr} saddr {rate} }} counter drop
	}}"""
UNIT = """\
# Written by `gemelo deploy render {site} {host}`.
[Unit]
Description=gemelo: limits of new connections to router and broker
Before=network-online.target
PartOf={target}

[Service]
Type=oneshot
RemainAfterExit=yes
TimeoutStartSec=30
ExecStart=/usr/sbin/nft -f {file}
ExecStop=/usr/sbin/nft delete table inet gemelo

[Install]
WantedBy={target}
"""


def ports(site: Site, host: str) -> tuple[int, ...]:
    """The ports of router and broker that listen on this host."""
    own = {"router": site.router.port, "broker": site.broker.port}
    return tuple(own[each.service.name] for each in processes(site, host) if each.service.name in own)


def firewall(site: Site, host: str) -> str:
    """The table for a host where router or broker run; its own hosts are known by those addresses that are numbers."""
    named = {4: "ip", 6: "ip6"}
    sets = [SET.format(name=f"hosts{family}", kind=_kind(family), what=_elements(site, family)) for family in named]
    for family, who in ((family, who) for family in named for who in ("host", "stranger")):
        for name in ("open", "rate"):
            what = "size 65535\n\t\tflags dynamic" + ("" if name == "open" else ",timeout\n\t\ttimeout 1m")
            sets.append(SET.format(name=f"{who}_{name}{family}", kind=_kind(family), what=what))
    chains = [
        CHAIN.format(who=who, family=family, saddr=saddr, most=most, rate=rate)
        for family, saddr in named.items()
        for who, most, rate in (("host", OPEN_OF_A_HOST, OF_A_HOST), ("stranger", OPEN_OF_A_STRANGER, OF_A_STRANGER))
    ]
    return TABLE.format(
        site=site.name, host=host, sets="\n".join(sets), ports=", ".join(map(str, ports(site, host))),
        all_strangers=OF_ALL_STRANGERS, chains="\n".join(chains),
    )  # fmt: skip


def _kind(family: int) -> str:
    return f"ipv{family}_addr"


def _elements(site: Site, family: int) -> str:
    found = [str(each) for each in _addresses(each.address for each in site.hosts.values()) if each.version == family]
    return f"elements = {{ {', '.join(sorted(set(found)))} }}" if found else ""


def _addresses(names: Iterable[str]) -> Iterator[ipaddress.IPv4Address | ipaddress.IPv6Address]:
    """A host that is named by a word may have any address: it is a stranger here."""
    for name in names:
        try:
            yield ipaddress.ip_address(name)
        except ValueError:
            continue
