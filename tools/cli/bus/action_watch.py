"""`gemelo action cancel` and `echo`: ending goals of anybody, and following how the goals of an action go."""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

from gemelo.libraries.runtime.actions import keys
from gemelo.libraries.runtime.errors import NoAnswer
from gemelo.schemas.actions import CancelRequest, GoalFeedback, GoalStatus, GoalStatuses, ResultRequest
from gemelo.schemas.message import Message, decode
from gemelo.schemas.reasons import because, plain
from gemelo.schemas.topics import Action
from gemelo.tools.cli.bus.action import action_of, action_option, indented
from gemelo.tools.cli.bus.field_path import FieldPath
from gemelo.tools.cli.common.errors import CommandError, ExitCode, unknown, usage
from gemelo.tools.cli.common.forms import Form, count_options, csv_lines, form_options, json_line, yaml_document
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import CommandSession, connect
from gemelo.tools.cli.parser import Options, Parser

TIMEOUT = 2.0  # [s]
LOOK = 0.02  # [s] between two looks for the first status


def cancel_options(parser: Parser) -> None:
    """Adds action and goal."""
    action_option(parser)
    parser.add_argument("goal", metavar="GOAL", nargs="?", default="", help="its id, or its beginning; else all")


def run_cancel(options: Options) -> ExitCode:
    """Cancels goals."""
    action = action_of(options.action)
    with connect() as session:
        for goal in cancel(session, action, options.goal):
            print(f"canceling {goal}")
    return ExitCode.OK


def echo_options(parser: Parser) -> None:
    """Adds action with part and field, count and form."""
    about = "a key of `gemelo action list`, and of it only the status, feedback or result, or a field of one"
    parser.add_argument("action", metavar="ACTION[.PART[.FIELD]]", help=about)
    count_options(parser, "goals have ended, or lines of the part have come")
    form_options(parser)


def run_echo(options: Options) -> ExitCode:
    """Follows the goals of an action, until Ctrl-C."""
    key, _, wanted = options.action.partition(".")
    action = action_of(key)
    part, _, path = wanted.partition(".")
    shown = ActionView(action, part, path, csv_lines() if options.csv else json_line if options.json else None)
    if options.csv and not part:
        raise usage(because("cli.action.csv", parts=tuple(f"{key}.{each}" for each in PARTS)))
    with connect() as session:
        return echo(session, action, options.count, shown)


PARTS = ("status", "feedback", "result")


class GoalStatement(NamedTuple):
    """One thing that was said of a goal."""

    part: str  # of PARTS
    goal: str
    message: Message | None  # None: nobody has answered, and
    problem: str = ""  # says why

    def fields(self) -> dict[str, object]:
        """Under their names, for a program."""
        if isinstance(self.message, GoalStatus):
            return {"goal": self.goal, "client": self.message.client, "status": self.message.status.name}
        return {"goal": self.goal, self.part: self.message}

    def text(self) -> str:
        """For a person."""
        if isinstance(self.message, GoalStatus):
            status = self.message.status.name
            if not self.message.client:
                return sentence(because("cli.action.status.nobody", goal=self.goal, status=status))
            return sentence(because("cli.action.status", goal=self.goal, client=self.message.client, status=status))
        of_goal = f" of {self.goal}" if self.part == "feedback" else ""
        told = indented(self.message) if self.message is not None else f"  # {self.problem}\n"
        return f"{self.part}{of_goal}:\n{told}---"


class ActionView:
    """What is printed of an action, and how; an empty `part` is all of them, `form` None is text for a person.

    Raises `CommandError` for a part or a field that is none.
    """

    def __init__(self, action: Action[Any, Any, Any], part: str = "", path: str = "", form: Form | None = None) -> None:
        if part and part not in PARTS:
            raise unknown("part of an action", part, PARTS)
        kinds: dict[str, type[Message]] = {"status": GoalStatus, "feedback": action.feedback, "result": action.result}
        self.part, self._form = part, form
        self._field = FieldPath(kinds[part], path) if path else None

    def print(self, said: GoalStatement) -> bool:
        """True if it was wanted, and is printed."""
        if self.part not in ("", said.part):
            return False
        if self._field is None:
            print(said.text() if self._form is None else self._form(said.fields()), flush=True)
        elif said.message is None:
            print(f"{said.goal}: {said.problem}", file=sys.stderr, flush=True)
        else:
            print((self._form or yaml_document)(self._field.of(said.message)), flush=True)
        return True


def cancel(session: CommandSession, action: Action[Any, Any, Any], begin: str) -> tuple[str, ...]:
    """The goals that are being cancelled: those whose id begins so; raises `CommandError` where there is none."""
    goal = _whole(session, action, begin) if begin else ""
    answer = session.node.call(keys.cancel_request(action), CancelRequest(goal_id=goal), timeout=TIMEOUT)
    if not answer.canceling:
        raise CommandError(because("cancel.nothing", answer.why or plain(answer.reason)))
    return answer.canceling


def _whole(session: CommandSession, action: Action[Any, Any, Any], begin: str) -> str:
    """The id that begins so."""
    latest, until = session.node.latest(keys.status_topic(action)), session.node.monotonic() + TIMEOUT
    while latest.message is None and session.node.monotonic() < until:
        session.node.wait(LOOK)
    goals = latest.message.goals if latest.message is not None else ()
    found = [each.goal_id for each in goals if each.goal_id.startswith(begin)]
    if len(found) != 1:
        known = ", ".join(f"{each.goal_id} ({each.status.name})" for each in goals)
        none = because("cli.action.known.none", action=action.key)
        why = because("cli.action.known", action=action.key, goals=known) if known else none
        if not found:
            raise CommandError(because("cli.action.no_goal", why, begin=begin))
        raise CommandError(because("cli.action.goals", why, begin=begin, count=len(found)))
    return found[0]


def echo(session: CommandSession, action: Action[Any, Any, Any], count: int | None, shown: ActionView) -> ExitCode:
    """Prints what becomes of each goal, its feedback and its result.

    Ends after `count` goals have ended, or so many lines of the only part that is shown.
    """
    known: dict[str, GoalStatus] = {}
    node, counted = session.node, 0

    def say(said: GoalStatement) -> None:
        nonlocal counted
        if count is not None and counted >= count:
            return
        if shown.print(said):
            counted += said.part == (shown.part or "result")
        if counted == count:
            node.stop()

    def on_statuses(statuses: GoalStatuses) -> None:
        for goal in statuses.goals:
            before = known.get(goal.goal_id)
            known[goal.goal_id] = goal
            if before is not None and before.status is goal.status:
                continue
            say(GoalStatement("status", goal.goal_id, goal))
            if goal.status.is_terminal:
                say(_result(session, action, goal.goal_id))

    def on_feedback(feedback: GoalFeedback) -> None:
        say(GoalStatement("feedback", feedback.goal_id, decode(action.feedback, bytes(feedback.feedback))))

    node.subscribe(keys.status_topic(action), on_statuses)
    node.subscribe(keys.feedback_topic(action), on_feedback)
    node.spin(rate=20.0)
    return ExitCode.OK


def _result(session: CommandSession, action: Action[Any, Any, Any], goal: str) -> GoalStatement:
    try:
        answer = session.node.call(keys.result_request(action), ResultRequest(goal_id=goal), timeout=TIMEOUT)
    except NoAnswer as error:
        return GoalStatement("result", goal, None, str(error))
    return GoalStatement("result", goal, decode(action.result, bytes(answer.result)))
