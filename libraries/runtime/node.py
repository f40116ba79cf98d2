"""The node that every service and every script is made of."""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import replace
from types import TracebackType
from typing import TYPE_CHECKING, Self, TypeVar

import msgspec

from gemelo.libraries.runtime.actions.client import ActionClient
from gemelo.libraries.runtime.bus import identity
from gemelo.libraries.runtime.bus.branches import principal_of
from gemelo.libraries.runtime.bus.connection import await_router, connect
from gemelo.libraries.runtime.bus.interface import Bus, Declaration
from gemelo.libraries.runtime.bus.name_holder import NameHolder, StopWatch
from gemelo.libraries.runtime.bus.wire import Encoded, encoded
from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.libraries.runtime.deployment import load_deployment, project_root, robot_name
from gemelo.libraries.runtime.endpoints import (
    LoopStatistics,
    NodeEndpoints,
    info_request,
    interfaces_request,
    parameter_request,
    parameters_request,
)
from gemelo.libraries.runtime.errors import NodeNameTaken
from gemelo.libraries.runtime.loop.loop import Loop
from gemelo.libraries.runtime.loop.task_queue import Worker
from gemelo.libraries.runtime.parameters import ParameterRegistry, ParameterSet
from gemelo.libraries.runtime.process.logs import BusHandler, Failures, line_logger
from gemelo.libraries.runtime.process.readiness import Readiness
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest, stop_on_signals
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
from gemelo.libraries.runtime.requests import client as requests
from gemelo.libraries.runtime.requests.limits import RequestRates
from gemelo.libraries.runtime.requests.server import Pending, RequestServer, UrgentServer
from gemelo.libraries.runtime.running import find_deployment
from gemelo.libraries.runtime.saved_parameters import SavedParameters
from gemelo.libraries.runtime.started import load_started
from gemelo.libraries.runtime.topics import Latest, LatestOnDemand, Publisher, Subscription
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.message import Message
from gemelo.schemas.reasons import Reason, plain
from gemelo.schemas.system import (
    NodeFiles,
    NodeInfo,
    Parameter,
    ParameterChange,
    ParameterValue,
    SetParameter,
    TopicStatistics,
)
from gemelo.schemas.topics import LOG, PARAMETER_CHANGES, STATISTICS, Action, Request, Topic, exchange_topic

if TYPE_CHECKING:
    from gemelo.libraries.runtime.actions.server import ActionServer, OnCancel, OnGoal, ReadGoal
    from gemelo.libraries.runtime.certificate_watch import CertificateWatch
    from gemelo.libraries.runtime.client_watch import Absences

M = TypeVar("M", bound=Message)
Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)
G = TypeVar("G", bound=Message)
F = TypeVar("F", bound=Message)
P = TypeVar("P", bound=msgspec.Struct)

BEAT = 1.0  # [s] between two touches of the readiness file
MOST_IGNORED = 16  # tokens of nobody that the log names


class Node:
    """One node: one task queue, and one thread of logic in which every handler and the step run.

    A node does not hear its own publications unless a subscription asks for it (`own=True`).
    """

    def __init__(
        self,
        name: str,
        deployment: Deployment | None = None,
        robot: str | None = None,
        bus: Bus | None = None,
        overrides: Mapping[str, ParameterValue] | None = None,
        log_level: str = "info",
        stop: ShutdownRequest | None = None,
        rates: RequestRates | None = None,
    ) -> None:
        """Waits for the router; raises `NodeNameTaken` where `name` lives already. `overrides` are parameters, `rates`
        how much of what is asked is taken, if not as much as usual. Without `deployment` it is on the bus of the robot
        that runs: raises `SeveralRobots` where several do and none is chosen."""
        self.clock: Clock = SYSTEM if bus is None else bus.clock
        self._identity = identity.identify(name, clock=self.clock)
        self.name = name
        self.log = line_logger(name, log_level)
        self._signals = stop is None
        self._stop = stop or ShutdownRequest()
        self.deployment = deployment if deployment is not None else self._find_deployment(robot or "", bus)
        self.robot = robot or robot_name(self.deployment)
        # A script's own error ends it where it happens; a service goes on, as others depend on it.
        self._loop = Loop(self._stop, self.clock, None if self._signals else Failures(self.log).take)
        self._worker = Worker(self.clock)
        self.unwritten = UnwrittenFiles(self.log.warning)
        self._readiness: Readiness | None = None
        self._problem: Reason | None = None  # why it is not ready
        self._endpoints = NodeEndpoints()
        self._rates = rates or RequestRates(clock=self.clock)
        from_file = self.deployment.parameters.get(name, {})
        saved = SavedParameters(project_root() / self.deployment.paths.run, name)
        self._parameters = ParameterRegistry(name, from_file, overrides or {}, saved, self.log)
        self._is_closed = False
        self._ignored_tokens: set[str] = set()
        self._certificate = self._watched(self.deployment.router.certificate)
        with stop_on_signals(self._stop) if self._signals else nullcontext():
            self._bus = bus or connect(self.deployment.router, self.robot, self.log, self._stop)
        try:
            self._identity = replace(self._identity, principal=principal_of(name, self._bus.common_name))
            identity.claim(self._bus, self._identity, self._warn_of_token)
            self._serve_about_itself()
        except BaseException:
            self._bus.close()
            raise
        self._name = NameHolder(self._identity)
        self._stop_watch = StopWatch()
        self._bus.watch_tokens(identity.bearers(self._identity), self._on_bearer)
        self._log_to_bus = BusHandler(lambda record: self.publisher(LOG).put(record), self.clock)
        self.log.addHandler(self._log_to_bus)
        self._statistics = LoopStatistics(self._identity, self.clock)
        self._at_end: list[Callable[[], object]] = []

    def _find_deployment(self, robot: str, bus: Bus | None) -> Deployment:
        """That of the twin which runs: asked of it, as soon as its router is there."""
        if bus is not None:
            return load_deployment()
        with stop_on_signals(self._stop) if self._signals else nullcontext():
            await_router(load_started().router, self.log, self._stop)
        return find_deployment(robot)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def publisher(self, topic: Topic[M]) -> Publisher[M]:
        """The publisher of a topic; the same one for every call."""
        publishers = self._endpoints.publishers
        publisher = publishers.get(topic.key)
        if publisher is None:
            publisher = publishers[topic.key] = Publisher(self._bus, topic, self.name, self._identity.instance)
        return publisher

    def unpublish(self, topic: Topic[M]) -> None:
        """Ends the publisher of a topic, with what late joiners would have got of it."""
        publisher = self._endpoints.publishers.pop(topic.key, None)
        if publisher is not None:
            publisher.close()

    def subscribe(
        self, topic: Topic[M], on_message: Callable[[M], object], own: bool = False, batch: float | None = None
    ) -> Subscription[M]:
        """`on_message(message)` runs in the thread of logic; `own`: also for what this node publishes.

        With `batch` all messages, of a LATEST topic too, are queued and handled together once per `batch` [s]:
        cheaper for a node that displays them. With 0 none is left out either, and each is handled as it comes.
        """
        subscription = Subscription(self._bus, self._loop, topic, on_message, self.log.warning, own, batch)
        self._endpoints.add(subscription)
        return subscription

    def subscribe_signed(self, topic: Topic[M], on_message: Callable[[M, str], object]) -> Subscription[M]:
        """As `subscribe`; `on_message(message, writer)` gets the node that wrote it: of a key that many write by its
        address there, else by the name that it says.

        Of a LATCHED topic, whose node the table names, it is told the instance of that node: see `watch_service`.
        """
        subscription = Subscription(
            self._bus, self._loop, topic, lambda message: None, self.log.warning, False, None, on_message
        )
        self._endpoints.add(subscription)
        return subscription

    def latest(self, topic: Topic[M], *, on_demand: bool = False) -> Latest[M]:
        """The newest message of a topic, with its age.

        `on_demand`: decoded only when somebody looks at it, in whatever thread that is; cheaper for what comes often.
        """
        if on_demand:
            unread = LatestOnDemand(self._bus, self._loop, topic, self.log.warning)
            self._endpoints.add(unread.subscription)
            return unread
        latest = Latest(topic, self.clock)
        self.subscribe(topic, latest.on_message)
        return latest

    def serve(self, request: Request[Q, R], handler: Callable[[Q], R | Encoded[R]], worker: bool = False) -> None:
        """Answers `request` with `handler(question)`; `Refused` raised there reaches the client.

        With `worker` the handler runs in the node's one worker thread, for answers that take longer
        than a period of the loop; what it shares with the thread of logic is its own care. A handler that changes
        something returns its answer `encoded` before the change: else what cannot be sent is refused after it.
        """

        def answer(question: Q, pending: Pending[R]) -> None:
            response = handler(question)
            if isinstance(response, Encoded):
                pending.send(response)
            else:
                pending.reply(response)

        self._serve(request, answer, worker)

    def serve_later(self, request: Request[Q, R], handler: Callable[[Q, Pending[R]], None]) -> RequestServer[Q, R]:
        """As `serve`; the handler keeps the `Pending` and answers when it can, from any thread."""
        return self._serve(request, handler)

    def call(
        self, request: Request[Q, R], question: Q, timeout: float = 2.0, on_tick: Callable[[], None] | None = None
    ) -> R:
        """Asks and blocks; raises `Refused`, or `NoAnswer` after `timeout` [s] at most.

        With `on_tick` queued tasks are handled meanwhile, and `on_tick` called 20 times a second: for scripts.
        """
        pending_call = requests.PendingCall(self._bus, request, question, timeout, self._loop.tasks.wake)
        if on_tick is not None:
            self._loop.wait_for(lambda: pending_call.is_over, timeout, on_tick)
        return pending_call.response()

    def ask(
        self, request: Request[Q, R], question: Q, timeout: float, on_answer: Callable[[], None]
    ) -> requests.PendingCall[Q, R]:
        """Asks, and waits for no answer; `on_answer` is called from another thread when `response()` blocks no more.

        `timeout` is in [s]. Raises `NoAnswer` where nobody serves the request, after a wait for whoever may just start.
        """
        return requests.PendingCall(self._bus, request, question, timeout, on_answer)

    def ask_at_once(
        self, request: Request[Q, R], question: Q, timeout: float, on_answer: Callable[[], None]
    ) -> requests.PendingCall[Q, R]:
        """As `ask`, `timeout` in [s], for a task that may hold nothing up: never waits for a server.

        Where nobody serves the request, `response()` raises `NoAnswer` at once; `on_answer` may be called from here.
        """
        return requests.PendingCall(self._bus, request, question, timeout, on_answer, appearance=0.0)

    def is_served(self, request: Request[Q, R]) -> bool:
        """True if a node serves `request` now. It is watched from the first look on, so that a later call finds it."""
        return self._bus.wait_served(request.key, 0.0)

    def serve_action(
        self, action: Action[G, F, R], on_goal: OnGoal[G], on_cancel: OnCancel, read: ReadGoal[G] | None = None
    ) -> ActionServer[G, F, R]:
        """Serves an action: `on_goal(goal_id, goal)` accepts or refuses, `on_cancel(goal_id)` returns None or why not.

        `read` decodes goals in pieces, between which the loop goes on.
        """
        from gemelo.libraries.runtime.actions.server import ActionServer  # most nodes serve none, and start sooner
        from gemelo.libraries.runtime.client_watch import ClientWatch

        clients = ClientWatch(self._watch_alive, lambda: self._bus.is_connected)
        server = ActionServer(
            action, on_goal, on_cancel, self._serve, self.publisher, clients, self.log.warning, self.post, self.clock,
            read,
        )  # fmt: skip
        self._loop.every(ActionServer.HEARTBEAT, server.beat)
        self._endpoints.actions.append(server)
        return server

    def action(self, action: Action[G, F, R]) -> ActionClient[G, F, R]:
        """A client of an action."""
        client = ActionClient(action, self._bus, self._loop, self.subscribe, self._identity.key)
        self._loop.every(ActionClient.TICK, client.tick)
        return client

    def absences(self) -> Absences:
        """Tells for how long the liveliness tokens of other nodes have been missing."""
        from gemelo.libraries.runtime.client_watch import Absences  # for servers of goals alone

        return Absences(self._watch_alive, lambda: self._bus.is_connected)

    def watch_service(self, name: str, on_change: Callable[[str, bool], None]) -> None:
        """`on_change(instance, is_there)` runs in the thread of logic for every process that bears a service's name.

        Of two instances that live the greater started later, and the other gives way.
        """

        def on_token(key: str, is_there: bool) -> None:
            if identity.is_token(key):
                self.post(lambda: on_change(key.rpartition("/")[2], is_there))

        self._bus.watch_tokens(identity.bearers_of(principal_of(name, ""), name), on_token)

    def watch_newcomers(self, on_newcomer: Callable[[], None]) -> None:
        """`on_newcomer()` runs in the thread of logic whenever a node has come, and for those that are there."""

        def on_token(key: str, is_there: bool) -> None:
            if is_there and identity.is_token(key):
                self.post(on_newcomer)

        self._bus.watch_tokens(identity.EACH, on_token)

    @property
    def address(self) -> str:
        """By which others know this node (bus/branches.py): its name, behind a person's certificate's."""
        return self._identity.address

    @property
    def token(self) -> str:
        """The key of this node's own liveliness token."""
        return self._identity.key

    def parameters(self, kind: type[P]) -> ParameterSet[P]:
        """Declares the fields of `kind`, with the values of the deployment file and of the command line."""
        return self._parameters.declare(kind)

    def set_parameter(self, name: str, value: ParameterValue) -> Parameter:
        """As the request that sets it; raises `Refused`."""
        return self._set_parameter(SetParameter(name=name, value=value))

    def info(self) -> NodeInfo:
        """The node's identity, endpoints, readiness, and its clock."""
        about = self._endpoints.info(self._identity, self.robot, self.clock)
        return msgspec.structs.replace(
            about,
            clock=self.now(),
            ready=self.is_ready,
            problem=str(self._problem or ""),
            why=self._problem,
            certificate_ends=self._certificate.ends if self._certificate is not None else None,
            unwritten=self.unwritten.sentence,
            files=NodeFiles() if self.clock.is_virtual else self._files(),
        )

    def _files(self) -> NodeFiles:
        root, paths, cell = project_root(), self.deployment.paths, self.deployment.cell
        return NodeFiles(
            robot=str(root / self.deployment.robot),
            cell=str(root / cell) if cell else "",
            run=str(root / paths.run),
            out=str(root / paths.out),
            programs=str(root / paths.programs),
        )

    def statistics(self) -> tuple[TopicStatistics, ...]:
        """The messages received, dropped and bad since the start, by key: of topics and of requests served."""
        return self._endpoints.statistics()

    def set_ready(self, ok: bool, why: Reason | str = "") -> None:
        """Says whether this node's state is valid; `why` it is not is logged when it changes."""
        reason = str(why)
        if ok or not reason:
            self._problem = None
        else:
            self._problem = why if isinstance(why, Reason) else plain(reason)
        if self._readiness is None:
            self._readiness = Readiness(project_root() / self.deployment.paths.run, self.name, self.unwritten)
        if ok != self._readiness.is_ready:
            self.log.info("%s%s", "ready" if ok else "not ready", f": {reason}" if reason else "")
        if ok:
            self._readiness.ready()
        else:
            self._readiness.not_ready(reason)

    @property
    def is_ready(self) -> bool:
        return self._readiness is not None and self._readiness.is_ready

    @property
    def is_connected(self) -> bool:
        """True if the router is connected."""
        return self._bus.is_connected

    @property
    def router(self) -> str:
        """The router of now, which has another name whenever it was started anew; empty without one."""
        return self._bus.router

    def alive(self) -> set[str]:
        """The addresses of all living nodes of the robot, this one too: names, behind a person's certificate's."""
        return identity.alive(self._bus, self._warn_of_token)

    def twins(self) -> dict[str, tuple[str, ...]]:
        """The processes of each address that several living nodes bear, the oldest first; empty where all is well."""
        return identity.twins(self._bus)

    def now(self) -> int:
        """[ns] UNIX time: for stamps."""
        return self.clock.unix()

    def monotonic(self) -> float:
        """[s] for durations."""
        return self.clock.monotonic()

    def spin(self, step: Callable[[int], object] = lambda now: None, rate: float = 50.0) -> None:
        """Calls `step(now [ns])` at `rate` [Hz], with queued tasks between, until SIGTERM, SIGINT or `stop()`.

        What the step raises is logged and ends the spin; so does what a handler raises, but in a service, which
        logs it and goes on.
        """
        self._loop.every(BEAT, self._beat)
        if not self._signals:
            gc.freeze()  # what a service has loaded by now stays: no pause to look through it again
        try:
            with stop_on_signals(self._stop) if self._signals else nullcontext():
                self._loop.spin(step, rate)
        except (BrokenPipeError, NodeNameTaken):
            raise  # whoever reads this program's output has enough; of a name that is lost a sentence says all
        except Exception as error:
            self.log.exception("ended by an error")
            error.is_logged = True  # type: ignore[attr-defined]
            raise
        finally:
            gc.unfreeze()  # else a circle of what is frozen outlives the interpreter, and nanobind calls it a leak
            self._loop.forget(self._beat)
            if self._readiness is not None:
                self._readiness.not_ready()

    @property
    def is_in_turn(self) -> bool:
        """True where this is called by a step or a handler that virtual time runs."""
        return self._loop.is_in_turn

    def begin(self, step: Callable[[int], object] = lambda now: None, rate: float = 50.0) -> None:
        """As `spin` at `rate` [Hz], in virtual time only: returns at once; the clock runs it while others wait."""
        self._loop.every(BEAT, self._beat)
        self._loop.begin(step, rate)

    def at_end(self, task: Callable[[], object]) -> None:
        """`task` is called when the node closes, while it can still publish; the last that was given is the first."""
        self._at_end.append(task)

    def wait(self, seconds: float) -> None:
        """Handles queued tasks for `seconds` [s]: for scripts that do not spin."""
        self._loop.wait(seconds)

    def every(self, period: float, task: Callable[[], None]) -> None:
        """`task` runs every `period` [s] in the thread of logic, beside the step, until `forget`."""
        self._loop.every(period, task)

    def forget(self, task: Callable[[], None]) -> None:
        """Ends an `every`."""
        self._loop.forget(task)

    def post(self, task: Callable[[], None]) -> None:
        """`task` runs in the thread of logic; from any thread, for what a library's own threads hear."""
        self._loop.tasks.put(task)

    def stop(self) -> None:
        """Lets `spin` return; from any thread."""
        self._stop.set()

    def close(self) -> None:
        """Leaves the bus; a node that was closed is of no more use."""
        if self._is_closed:
            return
        self._is_closed = True
        try:
            while self._at_end:
                self._at_end.pop()()
        finally:
            self._leave()

    def _leave(self) -> None:
        self._loop.end()
        if self._readiness is not None:
            self._readiness.not_ready()
        self._worker.close()
        self.log.removeHandler(self._log_to_bus)
        self._bus.close()

    def _serve(
        self, request: Request[Q, R], handler: Callable[[Q, Pending[R]], None], worker: bool = False
    ) -> RequestServer[Q, R]:
        server: RequestServer[Q, R]
        warn, rates = self.log.warning, self._rates
        tell = self.publisher(exchange_topic(request)).put if request.recorded else None
        if request.urgent:
            server = UrgentServer(self._bus, self._loop.tasks, request, handler, warn, rates, tell)
        else:
            put = self._worker.put if worker else self._loop.tasks.put
            server = RequestServer(self._bus, put, request, handler, warn, rates, tell)
        self._endpoints.servers.append(server)
        return server

    def _watch_alive(self, key: str, on_change: Callable[[bool], None]) -> Declaration:
        """`on_change(is_there)` runs in the thread of logic."""
        return self._bus.watch_alive(key, lambda is_there: self.post(lambda: on_change(is_there)))

    def _on_bearer(self, key: str, is_there: bool) -> None:
        """A token of this node's name; from the bus's own thread."""
        self.post(lambda: self._name.on_token(key, is_there, self.monotonic()))

    def _serve_about_itself(self) -> None:
        address = self._identity.address
        self.serve(info_request(address), lambda question: self.info())
        self.serve(interfaces_request(address), lambda question: self._endpoints.interfaces())
        self.serve(parameters_request(address), self._parameters.listed)
        self.serve(parameter_request(address), self._set_parameter)

    def _warn_of_token(self, text: str) -> None:
        """Once of each token, and of so many."""
        if text not in self._ignored_tokens and len(self._ignored_tokens) < MOST_IGNORED:
            self._ignored_tokens.add(text)
            self.log.warning("%s", text)

    def _set_parameter(self, wanted: SetParameter) -> Parameter:
        publisher, changes = self.publisher(PARAMETER_CHANGES), list[Encoded[ParameterChange]]()

        def encode_change(parameter: Parameter) -> None:
            encoded(parameter)  # the answer
            changes.append(publisher.encoded(ParameterChange(stamp=self.now(), node=self.name, parameter=parameter)))

        parameter = self._parameters.set(wanted, encode_change)
        publisher.put(changes[-1])
        return parameter

    def holds_name(self) -> bool:
        """False for a while after this process was stopped, until it is certain that no other bears its name by now.

        Call before each turn of a loop that must not act beside another.
        """
        return self._stop_watch.is_certain(self.clock.monotonic(), lambda: self.is_connected, lambda: self._name.newer)

    def _watched(self, certificate: str) -> CertificateWatch | None:
        """Its watch, which has looked at it once; None where this host shows none."""
        if not certificate:
            return None
        from gemelo.libraries.runtime.certificate_watch import CertificateWatch  # where there are certificates alone

        watch = CertificateWatch(certificate, self.log.warning)
        watch.beat()
        return watch

    def _beat(self) -> None:
        if objection := self._name.objection(self.monotonic()):
            raise NodeNameTaken(objection)
        if self._readiness is not None:
            self._readiness.beat()
        self._bus.require_reconnection()
        if self._certificate is not None:
            self._certificate.beat()
        self._endpoints.report_losses()
        report = self._statistics.report(self._loop.take_figures(), self._endpoints.statistics())
        if report is not None:
            self.publisher(STATISTICS).put(report)
