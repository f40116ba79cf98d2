"""`gemelo action cancel` and `echo`: ending goals of anybody, and following how the goals of an action go."""

from __future__ import annotations

from typing import Any

from schemas.actions import CancelRequest, GoalFeedback, GoalStatus, GoalStatuses, ResultRequest
from schemas.message import decode
from schemas.topics import Action
from services.cli.action import action_of, action_option, indented
from services.cli.errors import CommandError, ExitCode
from services.cli.parser import Options, Parser, positive_integer
from services.cli.session import Session, connect
from services.runtime.actions import keys
from services.runtime.errors import NoAnswer

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
    """Adds action and count."""
    action_option(parser)
    parser.add_argument("-n", "--count", type=positive_integer, metavar="N", help="end after N goals have ended")


def run_echo(options: Options) -> ExitCode:
    """Follows the goals of an action, until Ctrl-C."""
    action = action_of(options.action)
    with connect() as session:
        return echo(session, action, options.count)


def cancel(session: Session, action: Action[Any, Any, Any], begin: str) -> tuple[str, ...]:
    """The goals that are being cancelled: those whose id begins so; raises `CommandError` where there is none."""
    goal = _whole(session, action, begin) if begin else ""
    answer = session.node.call(keys.cancel_request(action), CancelRequest(goal_id=goal), timeout=TIMEOUT)
    if not answer.canceling:
        raise CommandError(f"nothing is cancelled: {answer.reason or f'{action.key} has no goal under way'}")
    return answer.canceling


def _whole(session: Session, action: Action[Any, Any, Any], begin: str) -> str:
    """The id that begins so."""
    latest, until = session.node.latest(keys.status_topic(action)), session.node.monotonic() + TIMEOUT
    while latest.message is None and session.node.monotonic() < until:
        session.node.wait(LOOK)
    goals = latest.message.goals if latest.message is not None else ()
    found = [each.goal_id for each in goals if each.goal_id.startswith(begin)]
    if len(found) != 1:
        known = ", ".join(f"{each.goal_id} ({each.status.name})" for each in goals) or "none"
        problem = f'no goal begins with "{begin}"' if not found else f'{len(found)} goals begin with "{begin}"'
        raise CommandError(f"{problem}; {action.key} knows {known}")
    return found[0]


def echo(session: Session, action: Action[Any, Any, Any], count: int | None) -> ExitCode:
    """Prints what becomes of each goal, its feedback and its result; ends after `count` results."""
    known: dict[str, GoalStatus] = {}
    node, ended = session.node, 0

    def on_statuses(statuses: GoalStatuses) -> None:
        nonlocal ended
        for goal in statuses.goals:
            before = known.get(goal.goal_id)
            known[goal.goal_id] = goal
            if before is not None and before.status is goal.status:
                continue
            print(f"goal {goal.goal_id} of {goal.client or 'nobody'}: {goal.status.name}", flush=True)
            if goal.status.is_terminal:
                print(f"result:\n{_result(session, action, goal.goal_id)}---", flush=True)
                ended += 1
        if count is not None and ended >= count:
            node.stop()

    def on_feedback(feedback: GoalFeedback) -> None:
        message = decode(action.feedback, bytes(feedback.feedback))
        print(f"feedback of {feedback.goal_id}:\n{indented(message)}---", flush=True)

    node.subscribe(keys.status_topic(action), on_statuses)
    node.subscribe(keys.feedback_topic(action), on_feedback)
    node.spin(rate=20.0)
    return ExitCode.OK


def _result(session: Session, action: Action[Any, Any, Any], goal: str) -> str:
    try:
        answer = session.node.call(keys.result_request(action), ResultRequest(goal_id=goal), timeout=TIMEOUT)
    except NoAnswer as error:
        return f"  # {error}\n"
    return indented(decode(action.result, bytes(answer.result)))
