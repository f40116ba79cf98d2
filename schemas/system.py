"""Messages about nodes: logs, statistics, information, parameters, failures."""

from __future__ import annotations

from enum import IntEnum

import msgspec

from gemelo.schemas.actions import NIL
from gemelo.schemas.message import Message
from gemelo.schemas.reasons import Reason


class LogLevel(IntEnum):
    """As in Python's logging and rcl_interfaces/Log."""

    DEBUG = 10
    INFO = 20
    WARNING = 30
    ERROR = 40
    FATAL = 50


class LogRecord(Message, frozen=True, kw_only=True):
    """One line of a node's log."""

    stamp: int = 0  # [ns] UNIX time
    node: str = ""
    level: LogLevel = LogLevel.INFO
    text: str = ""


class TopicStatistics(Message, frozen=True, kw_only=True):
    """The counters of one key in one node."""

    key: str = ""
    received: int = 0
    dropped: int = 0  # overrun in the inbox (LATEST) or lost on the way (EVERY)
    bad: int = 0  # not decodable; dropped, and reported once


class NodeStatistics(Message, frozen=True, kw_only=True):
    """The statistics of a node's loop, once a second."""

    stamp: int = 0  # [ns] UNIX time
    node: str = ""
    loop_rate: float = 0.0  # [Hz] achieved
    loop_late_max: float = 0.0  # [s] worst lateness of the last second
    cpu: float = 0.0  # [s/s] of one core
    topics: tuple[TopicStatistics, ...] = ()
    started: int = 0  # [ns] UNIX time of the node's start; 0: from a node that does not say it


class NodeFiles(Message, frozen=True, kw_only=True):
    """The files that a node was started with, as paths of its host; empty where it runs in virtual time."""

    robot: str = ""  # folder of robot.toml
    cell: str = ""  # cell.toml; empty: none
    run: str = ""
    out: str = ""
    programs: str = ""


class NodeInfo(Message, frozen=True, kw_only=True):
    """The identity and endpoints of a node."""

    node: str = ""
    robot: str = ""
    host: str = ""
    pid: int = 0
    version: str = ""  # empty: it could not be read
    started: int = 0  # [ns] UNIX time
    publishes: tuple[str, ...] = ()
    subscribes: tuple[str, ...] = ()
    serves: tuple[str, ...] = ()
    actions: tuple[str, ...] = ()
    clock: int = 0  # [ns] UNIX time by its own clock, as it answered
    ready: bool = False  # its state is valid
    problem: str = ""  # why it is not, where it says so
    certificate_ends: float | None = None  # [s] UNIX time, of the one that it shows to the router; None: it shows none
    unwritten: str = ""  # what it cannot write to its disk, and the remedies; it works on without
    files: NodeFiles = NodeFiles()
    why: Reason | None = None  # `problem` as data


class TopicInterface(Message, frozen=True, kw_only=True):
    """A topic as a node speaks or hears it, for those who do not have its message's class."""

    key: str = ""
    message: str = ""  # the class's name
    fields: tuple[tuple[str, str], ...] = ()  # name and type, as written where the class is defined
    delivery: str = ""  # of `gemelo.schemas.topics.Delivery`
    rate: float | None = None  # [Hz]; None: when there is something to say
    recorded: bool = False
    writer: str = ""
    about: str = ""


class Interfaces(Message, frozen=True, kw_only=True):
    """Every topic that a node publishes or subscribes to."""

    topics: tuple[TopicInterface, ...] = ()


class Empty(Message, frozen=True, kw_only=True):
    """Nothing to say."""


class Failure(Message, frozen=True, kw_only=True):
    """A request that was not carried out, and why."""

    kind: str = ""  # "bad request", "refused", "internal error"
    message: str = ""
    why: Reason | None = None  # `message` as data, where it has a code


ParameterValue = bool | int | float | str


class Parameter(Message, frozen=True, kw_only=True):
    """A declared parameter of a node, its type and present value."""

    name: str = ""
    type: str = ""  # "bool", "int", "float", "str"
    value: ParameterValue = False
    default: ParameterValue = False
    description: str = ""
    minimum: float | None = None
    maximum: float | None = None
    saved_in: str = ""  # in an answer: the file on the node's host that now has it for later starts


class Parameters(Message, frozen=True, kw_only=True):
    """All parameters of a node."""

    parameters: tuple[Parameter, ...] = ()


class ParameterChange(Message, frozen=True, kw_only=True):
    """A parameter of a running node that was set, with its new value."""

    stamp: int = 0  # [ns] UNIX time
    node: str = ""
    parameter: Parameter = Parameter()


class SetParameter(Message, frozen=True, kw_only=True):
    """A new value for a parameter; a wrong name, type or range is refused."""

    name: str = ""
    value: ParameterValue = False
    save: bool = False  # also for later starts of the process


class Exchange(Message, frozen=True, kw_only=True):
    """A question and its answer, as the node that has answered publishes them."""

    stamp: int = 0  # [ns] UNIX time of the answer
    duration: float = 0.0  # [s] from the arrival of the question to its answer
    clients: tuple[str, ...] = ()  # the sessions that asked: several where equal urgent questions were answered at once
    question: msgspec.Raw = NIL  # the request's own message
    answer: msgspec.Raw = NIL  # the response's own message; nil where there is a failure
    failure: Failure | None = None


class NodeRecord(Message, frozen=True, kw_only=True):
    """A node as a recording keeps it: who it is, what it speaks, and its parameters."""

    stamp: int = 0  # [ns] UNIX time
    node: str = ""
    info: NodeInfo = NodeInfo()
    topics: tuple[TopicInterface, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    clock_offset: float | None = None  # [s] what its clock showed more than the recorder's; None: not measured
    clock_bound: float = 0.0  # [s] by how much at most that is wrong
