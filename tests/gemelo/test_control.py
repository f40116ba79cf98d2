"""Control as scripts and commands have it: a real gateway without a device, and its clients, on a bus in memory."""

from __future__ import annotations

import os
import socket
import stat
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import msgspec
import pytest

import gemelo
from gemelo.api import control_file
from gemelo.api.control import Hold
from gemelo.api.session import Session
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.actions.keys import goal_request, result_request
from gemelo.libraries.runtime.bus.interface import BusReply
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.client_watch import RETURN, Absence
from gemelo.libraries.runtime.errors import GoalRefused
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.actions import GoalRequest, GoalResponse, ResultRequest
from gemelo.schemas.control import ControlAnswer, ControlState, ControlTake
from gemelo.schemas.deployment import Deployment, PathsSection
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.message import encode
from gemelo.schemas.motion import FollowErrorCode, FollowJointTrajectoryGoal
from gemelo.schemas.reasons import because
from gemelo.schemas.system import Failure
from gemelo.schemas.topics import CONTROL, CONTROL_TAKE, DEVICE_EVENTS, FOLLOW_JOINT_TRAJECTORY, GATEWAY_INPUTS, LOG
from gemelo.services.stepper_gateway.core import GatewayCore
from gemelo.services.stepper_gateway.inputs import BeganInput, unpacked
from gemelo.services.stepper_gateway.ledger.ledger_file import LedgerFile
from gemelo.services.stepper_gateway.parameters import GatewayParameters
from gemelo.services.stepper_gateway.shell import Shell
from gemelo.tools.cli.motion.control import describe
from tests.runtime.support import ROOT, spinning, until


class Lab:
    """A gateway whose device is off, and whoever connects to it."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self.network, self._stack = MemoryNetwork(), stack
        self.deployment = Deployment(
            robot="urdf/rm1", paths=PathsSection(out=str(folder / "out"), run=str(folder / "run"))
        )
        self.description = load_arm(ROOT / "urdf/rm1")
        self._folder = folder
        self._gateways = 0
        self.heard: list[tuple[str, bytes]] = []  # key and payload of all that was published
        self.log: list[str] = []
        self.start_gateway()
        listener = self.node("listener")
        listener.subscribe(LOG, lambda record: self.log.append(record.text))
        stack.enter_context(spinning(listener))

    def start_gateway(self) -> Node:
        self._gateways += 1
        node = self.gateway = self.node("stepper_gateway")
        parameters = node.parameters(GatewayParameters)
        ledger = self._stack.enter_context(
            closing(LedgerFile(self._folder / f"run{self._gateways}", "rm1", node.unwritten))
        )
        core = GatewayCore(self.description, self._gateways, parameters.value)
        self.shell = Shell(node, core, BeganInput(self._gateways, parameters.value), parameters, ledger)
        self._spin = spinning(node, self.shell.step)
        self._spin.__enter__()
        self._stack.callback(self.stop_gateway)
        return node

    def stop_gateway(self) -> None:
        spin, self._spin = self._spin, None
        if spin is not None:
            spin.__exit__(None, None, None)
            self.shell.finish()
            self.gateway.close()

    def node(self, name: str) -> Node:
        node = Node(name, self.deployment, robot="rm1", bus=MemoryBus(self.network), stop=ShutdownRequest())
        self._stack.callback(node.close)
        return node

    def arm(self, name: str) -> gemelo.Arm:
        arm = gemelo.Arm(Session(self.deployment, self.description, self.node(name)))
        self._stack.callback(arm.close)
        return arm


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.delenv(control_file.PATH_VARIABLE, raising=False)
    with ExitStack() as stack:
        yield Lab(tmp_path, stack)


def refusal(action: Callable[[], object]) -> gemelo.Refused:
    with pytest.raises(gemelo.Refused) as refused:
        action()
    return refused.value


def goal_code(arm: gemelo.Arm) -> int:
    """The code by which a goal is refused; that of the device, which is off, if not for control's sake."""
    with pytest.raises(GoalRefused) as refused:
        arm.node.action(FOLLOW_JOINT_TRAJECTORY).send(FollowJointTrajectoryGoal())
    return refused.value.code


def test_without_a_holder_nobody_is_refused_for_it(lab: Lab) -> None:
    ana, ben = lab.arm("ana-1"), lab.arm("ben-1")
    assert (ana.control.held, ana.control.holder, ana.control.may_move) == (False, "", True)
    assert goal_code(ben) == FollowErrorCode.DEVICE_FAILED


def test_in_the_block_others_are_refused_by_name_and_after_it_they_are_not(lab: Lab) -> None:
    ana, ben = lab.arm("ana-1"), lab.arm("ben-1")
    with ana.take_control("Ana"):
        assert until(lambda: ben.control.held)
        assert (ben.control.holder, ben.control.may_move, ben.control.is_mine) == ("Ana", False, False)
        assert goal_code(ben) == FollowErrorCode.NOT_IN_CONTROL
        assert goal_code(ana) == FollowErrorCode.DEVICE_FAILED
        refused = refusal(lambda: ben.speed(0.5))
        assert refused.check == "control"
        assert "Ana holds control of rm1, since " in str(refused.reason)
        assert f"from node ana-1 on {socket.gethostname()}" in str(refused.reason).replace("_", "-")
        assert refusal(lambda: ben.take_control("Ben")).check == "control"
        assert refusal(lambda: ana.speed(0.5)).check == "device"
        assert "BOOT" not in str(refused)
    assert until(lambda: not ben.control.held)
    assert goal_code(ben) == FollowErrorCode.DEVICE_FAILED


def test_streams_of_others_are_told_who_holds_control_and_the_holders_are_not_disturbed(lab: Lab) -> None:
    ana, ben = lab.arm("ana-1"), lab.arm("ben-1")
    told = []
    ana.node.subscribe(DEVICE_EVENTS, told.append)
    with ana.take_control("Ana"):
        ana.stream({"brazo_joint": 0.1})
        ben.stream({"brazo_joint": 0.1})
        assert until(lambda: any(event.client == "ben-1" for event in told))
        refused = refusal(lambda: [ben.stream({"brazo_joint": 0.1}) for _ in range(2)])
        assert "Ana holds control" in str(refused)

        def stream_on() -> None:
            for _ in range(200):
                ana.stream({"brazo_joint": 0.1})
                ana.wait_for(lambda: False, 0.01)

        assert "control" not in str(refusal(stream_on))  # the device is off, and that is all that she hears


def test_only_the_planner_may_stream_for_others(lab: Lab) -> None:
    ana, ben, planner = lab.arm("ana-1"), lab.node("ben-1"), lab.node("planner")
    told = []
    ana.node.subscribe(DEVICE_EVENTS, told.append)
    with ana.take_control("Ana"):
        for node, client in ((ben, "ana-1"), (planner, "ana-1"), (planner, "ben-1"), (planner, "")):
            told.clear()
            target = JointTargets(name=("brazo_joint",), position=(0.1,), client=client)

            def is_answered(node=node, target=target) -> bool:
                node.publisher(gemelo.topics.JOINT_TARGETS).put(target)
                return any(event.event == "target_refused" for event in told)

            assert until(is_answered)
            is_held = any("holds control" in event.detail for event in told)
            assert is_held == ((node, client) != (planner, "ana-1")), (node.name, client)


def test_a_hold_is_taken_over_by_force_and_the_former_holder_is_refused_until_it_takes_it_anew(lab: Lab) -> None:
    ana, ben = lab.arm("ana-1"), lab.arm("ben-1")
    with ana.take_control("Ana"):
        ben.take_control("Ben", force=True)
        assert until(lambda: not ana.control.is_mine)
        for _ in range(2):
            lost = refusal(lambda: ana.speed(0.5))
            assert (lost.check, lost.subject, lost.remedy) == ("control", "Ben", "arm.take_control()")
    assert ben.control.is_mine
    ben.control.give()
    ana.control.take()
    assert ana.control.holder == "ana-1"
    assert until(lambda: any("by force, from Ana (node ana-1" in line for line in lab.log))


def test_a_restarted_gateway_holds_for_nobody_and_the_former_holder_hears_so(lab: Lab) -> None:
    ana = lab.arm("ana-1")
    with ana.take_control("Ana"):
        lab.stop_gateway()
        lab.start_gateway()
        assert until(lambda: not ana.control.held)
        assert "nobody holds it" in str(refusal(lambda: ana.speed(0.5)))


def test_the_secret_is_never_published_nor_recorded_nor_logged(lab: Lab) -> None:
    seen: list[bytes] = []
    spy = MemoryBus(lab.network)
    keys = set(lab.network.subscriptions) | {p.key for p in lab.network.publications}
    for key in keys | {"@request/control/take", "@request/control/join", "@request/control/give", CONTROL.key}:
        spy.subscribe(key, gemelo.topics.CONTROL.delivery, lambda arrival: seen.append(arrival.payload), lambda n: None)
    ana, ben = lab.arm("ana-1"), lab.arm("ben-1")
    secret = ana.control.take("Ana")
    control_file.write(control_file.path_of("rm1", lab.deployment), secret, "Ana")
    refusal(lambda: ben.speed(0.5))
    ana.control.give()
    inputs = []
    ana.node.subscribe(GATEWAY_INPUTS, inputs.append)
    lab.stop_gateway()
    assert until(lambda: inputs)
    given = repr([each for message in inputs for each in unpacked(message.inputs)])
    assert given.count("ControlTake(") == given.count("ControlJoin(") == given.count("ControlGive(") == 1
    assert secret not in given
    assert seen
    assert not any(secret.encode() in payload for payload in seen)
    assert not any(secret in line for line in lab.log)


# The file by which the programs of one user share a hold.


@contextmanager
def takes(arm: gemelo.Arm) -> Iterator[str]:
    """As `Arm.take_control`, with the secret, as the command line takes it."""
    secret = arm.control.take("Ana")
    with Hold(arm.control):
        yield secret


def test_programs_of_the_same_user_share_the_hold_also_those_that_were_connected_before(lab: Lab) -> None:
    script, holder = lab.arm("pick-1"), lab.arm("cli-1")
    path = control_file.path_of("rm1", lab.deployment)
    with takes(holder) as secret:
        control_file.write(path, secret, "Ana")
        assert refusal(lambda: script.speed(0.5)).check == "device"
        assert until(lambda: holder.control.state.members == ("cli-1", "pick-1"))
        assert script.control.may_move
    page = lab.arm("panel")
    page.control.shares = False
    with takes(holder) as secret:
        control_file.write(path, secret, "Ana")
        assert refusal(lambda: page.speed(0.5)).check == "control"
        assert refusal(lambda: script.speed(0.5)).check == "device"  # the new hold, by its new secret


def test_the_file_is_of_mode_600_and_one_that_others_can_read_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "control.json"
    control_file.write(path, "s" * 64, "ana")
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert control_file.read(path).secret == "s" * 64
    path.chmod(0o640)
    with pytest.raises(gemelo.Error, match="mode 640: remove it"):
        control_file.read(path)


def test_a_link_in_the_files_place_is_not_followed(tmp_path: Path) -> None:
    path = tmp_path / "control.json"
    control_file.write(tmp_path / "other.json", "s" * 64, "ana")
    path.symlink_to(tmp_path / "other.json")
    assert control_file.read(path) is None


@pytest.mark.parametrize(
    "content",
    [b"", b"{}", b"\xff", b'{"secret":1}', b"[" * 4000, None],
    ids=["empty", "no fields", "no text", "wrong type", "deep", "a process that has ended"],
)
def test_a_file_that_says_nothing_of_a_living_holder_shares_nothing(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "control.json"
    hold = control_file.SharedHold("s" * 64, "ana", socket.gethostname(), 2**22 + 1)
    path.write_bytes(msgspec.json.encode(hold) if content is None else content)
    path.chmod(0o600)
    assert control_file.read(path) is None


def test_a_hold_of_another_host_on_a_shared_home_is_not_this_hosts(tmp_path: Path) -> None:
    path = tmp_path / "control.json"
    path.write_bytes(msgspec.json.encode(control_file.SharedHold("s" * 64, "ana", "other-host", os.getpid())))
    path.chmod(0o600)
    assert control_file.read(path) is None


def test_only_the_own_hold_is_removed_from_the_file(tmp_path: Path) -> None:
    path = tmp_path / "control.json"
    control_file.write(path, "s" * 64, "ana")
    control_file.remove(path, "t" * 64)
    assert path.exists()
    control_file.remove(path, "s" * 64)
    assert not path.exists()


# What comes that is no question of a client's.


def raw(lab: Lab, key: str, schema: str, payload: bytes) -> BusReply | None:
    """The answer to bytes."""
    answers: list[BusReply | None] = []
    MemoryBus(lab.network).ask(key, schema, payload, 3.0, answers.append)
    assert until(lambda: answers)
    return answers[0]


NAN = b"\xcb\x7f\xf8" + bytes(6)  # msgpack float64
BAD = [
    b"", b"\xc1", b"\x80" * 1000, NAN, b"\x81\xa4name" + NAN, b"\x81\xa6secret\xc4\x04abcd", b"\x81\xa5force\x01",
    b"\x81\xa4name\xdb\xff\xff\xff\xff", b"\x91" * 5000, b"\x82\xa4name\xa1a\xa5force" + NAN, b"\xa9" + b"x" * 600_000,
]  # fmt: skip


@pytest.mark.parametrize("key", ["control/take", "control/join", "control/give"])
def test_malformed_questions_are_refused_and_block_nothing(lab: Lab, key: str) -> None:
    schema = {"take": "ControlTake", "join": "ControlJoin", "give": "ControlGive"}[key.split("/")[1]]
    for payload in BAD:
        answer = raw(lab, key, schema, payload)
        assert answer is not None
        if answer.ok:  # unknown fields are ignored: then it is an empty question
            assert not msgspec.msgpack.decode(answer.payload, type=ControlAnswer).accepted
        else:
            assert msgspec.msgpack.decode(answer.payload, type=Failure).kind == "bad request"
    ana = lab.arm("ana-1")
    assert not ana.control.held
    with ana.take_control("Ana"):
        assert ana.control.is_mine


def test_a_stranger_that_writes_the_topic_changes_nothing(lab: Lab) -> None:
    ana, ben = lab.arm("ana-1"), lab.arm("ben-1")
    assert not ana.control.held
    forged = ControlState(held=True, name="mallory", epoch=99, number=99, members=("mallory",))
    ben.node.publisher(CONTROL).put(forged)
    with ana.take_control("Ana"):
        ben.node.publisher(CONTROL).put(forged)
        assert goal_code(ana) == FollowErrorCode.DEVICE_FAILED
        assert ana.control.is_mine


def test_a_holder_whose_token_was_never_there_loses_control_by_itself(lab: Lab) -> None:
    question = ControlTake(name="ghost", client=f"@id/local/ghost/{1:020d}.1.nowhere", secret="g" * 64)
    answer = raw(lab, CONTROL_TAKE.key, "ControlTake", encode(question))
    assert answer is not None
    assert answer.ok
    ana = lab.arm("ana-1")
    assert until(lambda: ana.control.holder == "ghost")
    assert until(lambda: not ana.control.held, 60.0)
    assert any("ghost (node ghost on nowhere) has lost it" in line for line in lab.log)


def test_a_goal_that_bears_the_holders_token_from_another_session_is_refused(lab: Lab) -> None:
    ana = lab.arm("ana-1")
    with ana.take_control("Ana"):
        epoch = ana.node.call(result_request(FOLLOW_JOINT_TRAJECTORY), ResultRequest()).epoch
        goal = msgspec.Raw(encode(FollowJointTrajectoryGoal()))
        question = GoalRequest(goal_id="x", client=ana.node.token, goal=goal, epoch=epoch)
        answer = raw(lab, goal_request(FOLLOW_JOINT_TRAJECTORY).key, "GoalRequest", encode(question))
        assert answer is not None
        response = msgspec.msgpack.decode(answer.payload, type=GoalResponse)
        assert (response.accepted, response.code) == (False, FollowErrorCode.NOT_IN_CONTROL)


# For how long a token is missing; time is given.


class Tokens:
    """A token that is switched by hand."""

    is_connected = True
    on_token: Callable[[bool], None]

    def watch(self, key: str, on_change: Callable[[bool], None]) -> Tokens:
        self.on_token = on_change
        return self

    def close(self) -> None:
        pass


def test_the_absence_of_a_token_counts_from_its_end_and_ends_when_it_is_back() -> None:
    tokens = Tokens()
    absence = Absence(tokens.watch, lambda: tokens.is_connected, "@id/a", 100.0)
    tokens.on_token(True)
    assert absence.seconds(110.0) == 0.0
    tokens.on_token(False)
    assert absence.seconds(112.5) == 2.5
    tokens.on_token(False)
    assert absence.seconds(113.0) == 3.0
    tokens.on_token(True)
    assert absence.seconds(114.0) == 0.0


@pytest.mark.parametrize("was_seen", [True, False])
def test_a_holder_that_dies_soon_after_it_was_first_watched_is_missed_for_no_longer(was_seen: bool) -> None:
    """Three seconds are three seconds: the time for a first sight of a token is no time that is added."""
    tokens = Tokens()
    absence = Absence(tokens.watch, lambda: tokens.is_connected, "@id/a", 100.0)
    if was_seen:
        tokens.on_token(True)
        tokens.on_token(False)
        assert absence.seconds(100.5) == pytest.approx(0.5)
    else:
        assert absence.seconds(101.9) == 0.0  # it may just not have been seen yet
    assert absence.seconds(103.0) == pytest.approx(3.0)


def test_nothing_counts_while_the_router_is_away_nor_until_its_clients_can_be_back() -> None:
    tokens = Tokens()
    absence = Absence(tokens.watch, lambda: tokens.is_connected, "@id/a", 100.0)
    tokens.on_token(True)
    absence.seconds(110.0)
    tokens.is_connected = False
    tokens.on_token(False)
    assert absence.seconds(200.0) == 0.0
    tokens.is_connected = True
    assert absence.seconds(201.0) == 0.0
    assert absence.seconds(201.0 + RETURN) == 0.0
    assert absence.seconds(202.0 + RETURN) == pytest.approx(1.0)


def test_who_it_is_is_said_in_a_sentence() -> None:
    state = ControlState(
        held=True, name="ana", node="cli-1", host="desk", since=10**18, members=("cli-1", "pick-3"), number=1
    )
    text = str(describe(state, "rm1", 10**9 + 12.4))
    assert text.startswith("ana holds control of rm1 since ")
    assert text.endswith(" (12 s), from node cli-1 on desk; shared by pick-3")
    assert describe(ControlState(), "rm1", 0.0) == because("cli.control.free", robot="rm1")
