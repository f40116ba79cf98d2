"""Commands about what is said on the bus: topic, request, action."""

from __future__ import annotations

from services.cli.exits import ExitCode
from services.cli.parser import Command, Options, Parser, positive_integer, positive_number

GROUPS = {
    "topic": "the topics and what passes on them",
    "request": "the requests that nodes answer",
    "action": "the actions that nodes carry out",
}


def topic_list(options: Options) -> ExitCode:
    from services.cli.topics import listing

    print(listing())
    return ExitCode.OK


def topic_name(parser: Parser) -> None:
    parser.add_argument("topic", metavar="TOPIC", help="a key of `gemelo topic list`")


def topic_info(options: Options) -> ExitCode:
    from services.cli.topics import information, topic_of

    print(information(topic_of(options.topic)), end="")
    return ExitCode.OK


def echo_options(parser: Parser) -> None:
    topic_name(parser)
    count = parser.add_mutually_exclusive_group()
    count.add_argument("--once", dest="count", action="store_const", const=1, help="the first one only")
    count.add_argument("-n", "--count", type=positive_integer, metavar="N", help="end after N messages")
    parser.add_argument("--json", action="store_true", help="a JSON object per line")


def topic_echo(options: Options) -> ExitCode:
    from services.cli.session import connect
    from services.cli.topics import topic_of
    from services.cli.traffic import echo

    topic = topic_of(options.topic)
    with connect() as session:
        return echo(session, topic, options.count, options.json)


def hz_options(parser: Parser) -> None:
    topic_name(parser)
    parser.add_argument("-w", "--window", type=positive_integer, default=10_000, metavar="N", help="messages averaged")
    parser.add_argument("-n", "--count", type=positive_integer, metavar="N", help="end after N reports")


def topic_hz(options: Options) -> ExitCode:
    from services.cli.session import connect
    from services.cli.topics import topic_of
    from services.cli.traffic import hz

    topic = topic_of(options.topic)
    with connect() as session:
        return hz(session, topic, options.window, options.count)


def pub_options(parser: Parser) -> None:
    topic_name(parser)
    parser.add_argument("message", metavar="JSON", help="an empty stamp becomes the present time")
    parser.add_argument("-r", "--rate", type=positive_number, metavar="HZ", help="again and again, until Ctrl-C")
    parser.add_argument("-n", "--count", type=positive_integer, metavar="N", help="end after N messages")


def topic_pub(options: Options) -> ExitCode:
    from services.cli.session import connect
    from services.cli.topics import message_of, topic_of
    from services.cli.traffic import publish

    topic = topic_of(options.topic)
    message = message_of(topic.message, options.message)
    with connect() as session:
        return publish(session, topic, message, options.rate, options.count)


def request_list(options: Options) -> ExitCode:
    from services.cli.topics import requests

    print(requests())
    return ExitCode.OK


def call_options(parser: Parser) -> None:
    parser.add_argument("request", metavar="REQUEST", help="a key of `gemelo request list`")
    parser.add_argument("message", metavar="JSON", nargs="?", default="{}", help="what is asked")


def request_call(options: Options) -> ExitCode:
    from services.cli.session import connect
    from services.cli.topics import message_of, request_of
    from services.cli.traffic import call

    request = request_of(options.request)
    message = message_of(request.request, options.message)
    with connect() as session:
        return call(session, request, message)


def action_list(options: Options) -> ExitCode:
    from services.cli.topics import actions

    print(actions())
    return ExitCode.OK


def action_name(parser: Parser) -> None:
    parser.add_argument("action", metavar="ACTION", help="a key of `gemelo action list`")


def action_info(options: Options) -> ExitCode:
    from services.cli.topics import action_information, action_of

    print(action_information(action_of(options.action)), end="")
    return ExitCode.OK


def goal_options(parser: Parser) -> None:
    action_name(parser)
    parser.add_argument("goal", metavar="GOAL", help="the goal as JSON, a file that holds it, or - for standard input")
    parser.add_argument("-f", "--feedback", action="store_true", help="show the feedback")


def action_send_goal(options: Options) -> ExitCode:
    from services.cli.action_goal import send_goal, text_of
    from services.cli.session import connect
    from services.cli.topics import action_of, message_of

    action = action_of(options.action)
    goal = message_of(action.goal, text_of(options.goal))
    with connect() as session:
        return send_goal(session, action, goal, options.feedback)


COMMANDS = (
    Command(("topic", "list"), "all topics: message, rate, delivery, writer", topic_list),
    Command(("topic", "info"), "one topic and the fields of its message", topic_info, topic_name),
    Command(("topic", "echo"), "print messages as YAML, until Ctrl-C", topic_echo, echo_options),
    Command(("topic", "hz"), "measure how often messages come, until Ctrl-C", topic_hz, hz_options),
    Command(("topic", "pub"), "publish a message once, or at a rate", topic_pub, pub_options),
    Command(("request", "list"), "all requests: message, answer, server", request_list),
    Command(("request", "call"), "ask, and print the answer as YAML", request_call, call_options),
    Command(("action", "list"), "all actions: goal, feedback, result, server", action_list),
    Command(("action", "info"), "one action and the fields of its messages", action_info, action_name),
    Command(
        ("action", "send_goal"), "send a goal and wait for its result; Ctrl-C cancels", action_send_goal, goal_options
    ),
)
