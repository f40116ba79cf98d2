"""`gemelo action`: the table of actions, and sending a goal without a planner."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gemelo.api.errors import reason_of
from gemelo.libraries.runtime.errors import GoalRefused
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.message import Message
from gemelo.schemas.reasons import because
from gemelo.schemas.text_file import NotUtf8, decode_text
from gemelo.schemas.topics import ACTIONS, Action
from gemelo.tools.cli.bus.messages import dump, fields_of, message_of
from gemelo.tools.cli.common.errors import CommandError, ExitCode, unknown, usage
from gemelo.tools.cli.common.forms import json_line, print_value
from gemelo.tools.cli.common.language import columns, sentence, translated
from gemelo.tools.cli.common.session import CommandSession, connect, share_control
from gemelo.tools.cli.common.terminal import CANCELLING, two_stage_interrupt
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.parser import Choices, Options, Parser, json_option

if TYPE_CHECKING:
    from gemelo import Robot

LONGEST_HOLD = 3600.0  # [s] that a person may hold the arm on its path


def run_list(options: Options) -> ExitCode:
    """Prints the table of actions."""
    return print_value([head_of(each) for each in ACTIONS], options.json, listing)


def action_option(parser: Parser) -> None:
    """Adds the action."""
    parser.add_argument("action", metavar="ACTION", help="a key of `gemelo action list`")


def info_options(parser: Parser) -> None:
    """Adds action and --json."""
    action_option(parser)
    json_option(parser)


def run_info(options: Options) -> ExitCode:
    """Prints one action."""
    action = action_of(options.action)
    return print_value(about(action), options.json, lambda: information(action))


def goal_options(parser: Parser) -> None:
    """Adds action, goal, --feedback and --json."""
    action_option(parser)
    parser.add_argument("goal", metavar="GOAL", help="the goal as JSON, a file that holds it, or - for standard input")
    parser.add_argument("-f", "--feedback", action="store_true", help="show the feedback")
    parser.add_argument("--json", action="store_true", help="JSON lines: accepted, feedback, status and result")


def run_send_goal(options: Options) -> ExitCode:
    """Sends a goal and waits for its result."""
    action = action_of(options.action)
    goal = message_of(action.goal, goal_text(options.goal))
    with connect() as session:
        share_control(session)
        return send_goal(session, action, goal, options.feedback, options.json)


def choices(robot: Robot | None) -> Choices:
    """The actions."""
    return {"": [action.key for action in ACTIONS]}


def listing() -> str:
    """The table of all actions."""
    rows = [
        (a.key, a.goal.__name__, a.feedback.__name__, a.result.__name__, a.server, translated(a.about)) for a in ACTIONS
    ]
    return table(columns("action", "goal", "feedback", "result", "server", "about"), rows)


def action_of(name: str) -> Action[Message, Message, Message]:
    """The action of that name; raises `CommandError` with the nearest name."""
    for action in ACTIONS:
        if action.key == name.strip("/"):
            return action
    raise unknown("action", name, [action.key for action in ACTIONS])


def information(action: Action[Message, Message, Message]) -> str:
    """One action and the fields of its three messages as YAML."""
    return dump(about(action))


def head_of(action: Action[Any, Any, Any]) -> dict[str, str]:
    """A row of the table, by its names."""
    parts = {"goal": action.goal, "feedback": action.feedback, "result": action.result}
    names = {part: kind.__name__ for part, kind in parts.items()}
    return {"action": action.key, **names, "server": action.server, "about": action.about}


def about(action: Action[Any, Any, Any]) -> dict[str, object]:
    """One action and the fields of its three messages, by their names."""
    parts = {"goal": action.goal, "feedback": action.feedback, "result": action.result}
    fields = {part: {"message": kind.__name__, "fields": fields_of(kind)} for part, kind in parts.items()}
    return {"action": action.key, "about": action.about, "server": action.server, **fields}


def goal_text(source: str) -> str:
    """The goal's JSON: `source` itself, standard input for `-`, or the content of the file of that name."""
    if source.lstrip().startswith("{"):
        return source
    try:
        return decode_text(sys.stdin.buffer.read() if source == "-" else Path(source).read_bytes())
    except (OSError, NotUtf8) as error:
        raise usage(because("cli.action.goal", error=str(error))) from error


def send_goal(
    session: CommandSession,
    action: Action[Message, Message, Message],
    goal: Message,
    with_feedback: bool,
    as_json: bool = False,
) -> ExitCode:
    """Sends the goal and waits for its result; Ctrl-C cancels."""
    client = session.node.action(action)

    def say(value: object, text: str) -> None:
        print(json_line(value) if as_json else text, flush=True)

    def on_feedback(feedback: Any) -> None:
        say({"feedback": feedback}, f"feedback:\n{indented(feedback)}---")

    with two_stage_interrupt() as interrupt:

        def cancel_once() -> None:
            if interrupt.is_set and not interrupt.is_answered:
                interrupt.is_answered = True
                handle.cancel()
                print(sentence(CANCELLING), file=sys.stderr if as_json else sys.stdout, flush=True)

        try:
            handle = client.send(goal, on_feedback=on_feedback if with_feedback else None)
        except GoalRefused as error:
            raise CommandError(because("refused.by", reason_of(error), server=action.server)) from error
        say({"accepted": handle.goal_id}, sentence(because("cli.action.accepted", goal=handle.goal_id)))
        outcome = handle.wait(LONGEST_HOLD, on_tick=cancel_once)
    result = indented(outcome.result) if outcome.result else ""
    say(
        {"status": outcome.status.name, "result": outcome.result},
        f"result: {outcome.status.name}\n{result}".removesuffix("\n"),
    )
    if outcome.status is GoalStatusCode.SUCCEEDED:
        return ExitCode.OK
    return ExitCode.CANCELLED if interrupt.is_set else ExitCode.FAILED


def indented(message: Message) -> str:
    """The message as YAML, indented."""
    return "".join(f"  {line}\n" for line in dump(message).splitlines())
