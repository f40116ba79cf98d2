"""Whoever has a certificate uses its own branch of tokens, answers and logs alone: no node is kept from starting, no
dead client is taken for a living one, and nobody speaks for another. Each attack is shown first at an open router.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.runtime.bus import branches, identity
from gemelo.libraries.runtime.bus.branches import address_of, branch_of, name_in, read_under, served_under, writer_at
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.bus.zenoh_declarations import encoding_of
from gemelo.libraries.runtime.endpoints import info_request
from gemelo.libraries.runtime.errors import NoAnswer, NodeNameTaken
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.deployment import Deployment, PathsSection, RouterSection
from gemelo.schemas.message import encode
from gemelo.schemas.roles import ROLE_OF_NODE, ROLES, SERVICES
from gemelo.schemas.system import Empty, NodeInfo, NodeStatistics
from gemelo.schemas.topics import JOG, JOINT_TARGETS, STATISTICS, Topic
from tests.runtime.locks import Lock, LockedRouter, sessions
from tests.runtime.support import RouterProcess, hear, spinning, until

PEOPLE = ("operator.desk", "operator.lab", "viewer.desk", "viewer.lab", "script.desk")
SHOWN = tuple(role.name for role in ROLES if role.node) + PEOPLE
NODE_OF = {role.name: role.node for role in ROLES if role.node}
OTHERS = set(SHOWN) - {"logger"}
NAME = st.from_regex(branches.NAME, fullmatch=True)
PRINCIPAL = st.from_regex(branches.PRINCIPAL, fullmatch=True)
Sections = dict[str, RouterSection]
Sessions = dict[str, zenoh.Session]


@pytest.fixture(scope="module")
def locked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Sections]:
    lock = Lock(tmp_path_factory.mktemp("lock"), SHOWN)
    router = LockedRouter(tmp_path_factory.mktemp("locked"), lock)
    yield {name: router.section(name) for name in SHOWN}
    router.stop()


@pytest.fixture(scope="module")
def unlocked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Sections]:
    router = RouterProcess(tmp_path_factory.mktemp("open"))
    yield dict.fromkeys(SHOWN, router.deployment.router)
    router.stop()


@contextmanager
def node_of(section: RouterSection, name: str, folder: Path) -> Iterator[Node]:
    deployment = Deployment(paths=PathsSection(run=str(folder), out=str(folder)))
    with Node(name, deployment, robot="rm1", bus=ZenohBus(section, "rm1")) as node:
        yield node


@contextmanager
def tokens(session: zenoh.Session, *keys: str) -> Iterator[None]:
    declared = [session.liveliness().declare_token(key) for key in keys]
    yield
    for each in declared:
        each.undeclare()


def seen(session: zenoh.Session, key: str = "@id/*/*/*") -> set[str]:
    return {str(reply.ok.key_expr) for reply in session.liveliness().get(key, timeout=30.0) if reply.ok}


def settle(one: zenoh.Session, principal: str, other: zenoh.Session) -> None:
    """Returns when `other` has seen what `one` declared before."""
    barrier = f"@id/{principal}/{own_node(principal)}/barrier"
    with tokens(one, barrier):
        assert until(lambda: barrier in seen(other, barrier))


def own_node(principal: str) -> str:
    return NODE_OF.get(principal, "cli-1")


@given(PRINCIPAL, NAME)
def test_an_address_leads_back_to_its_branch_and_only_a_services_role_bears_its_name(principal: str, node: str) -> None:
    address = address_of(principal, node)
    assert address is not None
    assert branch_of(address) == f"{principal}/{node}"
    assert name_in(address) == node
    for service, owner in product(SERVICES, (principal, *ROLE_OF_NODE.values())):
        assert (address_of(owner, service) is not None) == (ROLE_OF_NODE[service] == owner)


@given(st.text(max_size=40), st.text(max_size=40))
def test_what_is_no_name_and_no_wildcard_has_an_address(principal: str, node: str) -> None:
    address = address_of(principal, node)
    if address is not None:
        assert not set("*$?#/ ") & set(principal + node)
    assert address_of("*", "planner") is address_of("viewer", "*") is address_of("**", "cli-1") is None
    assert writer_at("rm1/log/by/*/planner") is None


def borne(opened: Sessions) -> dict[str, set[str]]:
    """By principal, those of whose tokens in its branch the logger sees: everyone tries every branch."""
    with ExitStack() as stack:
        for owner, (name, session) in product(opened, opened.items()):
            stack.enter_context(tokens(session, f"@id/{owner}/{own_node(owner)}/{name}"))
        for name, session in opened.items():
            settle(session, name, opened["logger" if name != "logger" else "planner"])
        found: dict[str, set[str]] = {owner: set() for owner in opened}
        for _, owner, _, name in (key.split("/") for key in seen(opened["logger"])):
            # The logger's own token needs no router, and a barrier may be seen for a moment after its end.
            found[owner] |= {name} - {"logger", "barrier"}
    return found


def test_a_token_stands_in_its_own_branch_alone(locked: Sections, unlocked: Sections) -> None:
    with sessions(unlocked) as opened:
        assert borne(opened) == dict.fromkeys(SHOWN, OTHERS)
    with sessions(locked) as opened:
        assert borne(opened) == {owner: {owner} & OTHERS for owner in SHOWN}


def has(node: Node, wanted: set[str | None]) -> bool:
    return node.alive() >= wanted


WILD = ("@id/*/*/*", "@alive/*/*", "@id/viewer.desk/*/*", "@alive/viewer.desk/*")


def test_a_viewers_wildcard_token_keeps_no_node_from_starting_and_is_reported(
    locked: Sections, unlocked: Sections, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for sections, is_locked in ((unlocked, False), (locked, True)):
        principal = "operator.desk" if is_locked else "local"
        wanted = {"planner", address_of(principal, "cli-1")}
        with (
            sessions({"viewer.desk": sections["viewer.desk"], "logger": sections["logger"]}) as opened,
            tokens(opened["viewer.desk"], *WILD),
        ):
            settle(opened["viewer.desk"], "viewer.desk", opened["logger"])
            assert ("@id/*/*/*" in seen(opened["logger"])) is not is_locked
            with (
                node_of(sections["planner"], "planner", tmp_path),
                node_of(sections["operator.desk"], "cli-1", tmp_path) as command,
            ):
                assert until(partial(has, command, wanted))
                assert all("*" not in each for each in command.alive())
        said = capsys.readouterr().err
        assert "ignored the liveliness token '@alive/viewer.desk/*', which is no node's" in said
        assert said.count("'@alive/viewer.desk/*'") <= 2  # once by each node


@pytest.mark.parametrize(
    "key", ["@id/local/a/*", "@id/local/a/x", "@id/*/*/*", "@id/local/a/1.2", "@id/local/a/" + "9" * 400]
)
def test_a_token_that_is_no_nodes_takes_no_name(key: str) -> None:
    network = MemoryNetwork()
    MemoryBus(network).declare_alive(key)
    warned: list[str] = []
    identity.claim(MemoryBus(network), identity.identify("a"), warned.append)
    assert all("ignored the liveliness token" in each for each in warned)


def test_a_name_of_a_service_needs_its_certificate(locked: Sections) -> None:
    with (
        pytest.raises(
            NodeNameTaken, match=r'node name "planner": the certificate "viewer.desk" of .*viewer.desk.pem may'
        ),
        node_of(locked["viewer.desk"], "planner", Path()),
    ):
        pass


def outlives(sections: Sections, make_copy: Callable[[str], str], folder: Path) -> bool:
    """True if a viewer's token keeps a holder's from being missed after her end."""
    changes: list[bool] = []
    gateway = ZenohBus(sections["gateway"], "rm1")
    with sessions({"viewer.desk": sections["viewer.desk"], "logger": sections["logger"]}) as opened:
        with node_of(sections["operator.desk"], "cli-1", folder) as holder:
            gateway.watch_alive(holder.token, changes.append)
            assert until(lambda: changes == [True])
            copy = opened["viewer.desk"].liveliness().declare_token(make_copy(holder.token))
            settle(opened["viewer.desk"], "viewer.desk", opened["logger"])
        is_missed = until(lambda: changes == [True, False], 3.0)
        copy.undeclare()
    gateway.close()
    return not is_missed


def test_a_copy_of_a_holders_token_keeps_her_alive_only_where_the_lock_is_open(
    locked: Sections, unlocked: Sections, tmp_path: Path
) -> None:
    assert outlives(unlocked, lambda token: token, tmp_path)
    assert not outlives(locked, lambda token: token, tmp_path)


@pytest.mark.parametrize("copy", ["@id/*/*/*", "@id/viewer.desk/*/*", "@id/**"])
def test_no_wildcard_token_keeps_a_holder_alive(
    locked: Sections, unlocked: Sections, tmp_path: Path, copy: str
) -> None:
    assert not outlives(unlocked, lambda token: copy, tmp_path)
    assert not outlives(locked, lambda token: copy, tmp_path)


def test_nobody_answers_for_another_node_behind_the_lock(locked: Sections, unlocked: Sections, tmp_path: Path) -> None:
    def answers(sections: Sections, forged: str, wanted: str) -> str:
        """What the viewer's answer under `forged` makes an operator believe of the version of `wanted`."""
        lie = encode(NodeInfo(node="planner", version="forged"))

        def on_query(query: zenoh.Query) -> None:
            with query:
                query.reply(query.key_expr, lie, encoding=encoding_of("NodeInfo"))

        with sessions({"viewer.desk": sections["viewer.desk"], "logger": sections["logger"]}) as opened:
            queryable = opened["viewer.desk"].declare_queryable(served_under(forged), on_query)
            settle(opened["viewer.desk"], "viewer.desk", opened["logger"])
            with node_of(sections["operator.desk"], "cli-1", tmp_path) as command, suppress(NoAnswer):
                return command.call(info_request(wanted), Empty(), timeout=0.5).version
            queryable.undeclare()
        return ""

    for forged in ("@node/*/*/info", "@node/planner/planner/info"):
        assert answers(unlocked, forged, "planner") == "forged"
        assert answers(locked, forged, "planner") == ""
    assert answers(locked, "@node/viewer.desk/cli-7/info", "viewer.desk/cli-7") == "forged"  # that one is its own


def test_forged_statistics_and_logs_are_nobodys_behind_the_lock(
    locked: Sections, unlocked: Sections, tmp_path: Path
) -> None:
    def believed(sections: Sections) -> set[str]:
        """The nodes whose statistics the logger believes to have got of a viewer's."""
        heard: list[str] = []
        with (
            node_of(sections["logger"], "logger", tmp_path) as logger,
            sessions({"viewer.desk": sections["viewer.desk"]}) as opened,
        ):
            logger.subscribe(STATISTICS, lambda message: heard.append(message.node))
            session = opened["viewer.desk"]
            branched = {f"statistics/by/{branch}": node for branch, node in (
                ("gateway/stepper_gateway", "stepper_gateway"), ("viewer.desk/stepper_gateway", "stepper_gateway"),
                ("viewer.desk/cli-1", "stepper_gateway"), ("operator.desk/cli-2", "cli-2"), ("viewer.desk/*", ""),
                ("viewer.desk/cli-4", "cli-4"),
            )}  # fmt: skip
            forged = {"statistics": "stepper_gateway", **branched}

            def send() -> None:
                for key, node in forged.items():
                    payload = encode(NodeStatistics(stamp=1, node=node))
                    session.put(key, payload, encoding=encoding_of("NodeStatistics"))

            assert hear(logger, lambda: send() or "cli-4" in heard)
            assert hear(logger, lambda: send() or heard.count("cli-4") > 3)
        return set(heard)

    assert believed(unlocked) == {"stepper_gateway", "cli-2", "cli-4"}
    assert believed(locked) == {"cli-4"}
    assert read_under("statistics") == "statistics/by/*/*"


@pytest.mark.parametrize("topic", [JOG, JOINT_TARGETS])
def test_nobody_jogs_or_streams_targets_as_another_persons_node_behind_the_lock(
    locked: Sections, unlocked: Sections, tmp_path: Path, topic: Topic[Any]
) -> None:
    reader = "planner" if topic is JOG else "stepper_gateway"

    def believed(sections: Sections) -> set[str]:
        """The nodes that the reader believes to have written, where operator.lab writes in every branch."""
        heard: list[str] = []
        with (
            node_of(sections[ROLE_OF_NODE[reader]], reader, tmp_path) as node,
            sessions({"operator.lab": sections["operator.lab"]}) as opened,
        ):
            node.subscribe_signed(topic, lambda message, writer: heard.append(writer))
            tried = ("operator.desk/cli-1", "panel/panel", "planner/planner", "operator.lab/*", "operator.lab/cli-1")
            keys = [topic.key, *(f"{topic.key}/by/{branch}" for branch in tried)]

            def send() -> None:
                for key in keys:
                    payload, schema = encode(topic.message(stamp=1)), topic.message.__name__
                    opened["operator.lab"].put(key, payload, encoding=encoding_of(schema))
                    node.wait(0.02)  # of a LATEST topic the newest message alone is handed over

            assert hear(node, lambda: send() or heard.count("operator.lab/cli-1") > 3)
        return set(heard)

    assert believed(unlocked) == {"operator.desk/cli-1", "panel", "planner", "operator.lab/cli-1"}
    assert believed(locked) == {"operator.lab/cli-1"}


def test_people_of_one_role_find_one_another_by_their_certificates(locked: Sections, tmp_path: Path) -> None:
    with (
        node_of(locked["operator.desk"], "mine", tmp_path) as desk,
        node_of(locked["operator.lab"], "mine", tmp_path) as lab,
        spinning(desk),
    ):
        assert until(lambda: lab.alive() == {"operator.desk/mine", "operator.lab/mine"})
        assert lab.call(info_request("operator.desk/mine"), Empty()).node == "mine"
