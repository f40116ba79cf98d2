"""`stepper_gateway` again: everything that its core was given, at the recorded readings of its clocks.

What it says on the bus is compared with the recorded messages. What goes to the device, to clients and into the log is
compared by the digest that the gateway has kept with each input.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from msgspec.structs import replace

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.recordings.table import action_topics, recorded_topics
from gemelo.schemas.device import GatewayInputs
from gemelo.schemas.message import Message
from gemelo.schemas.topics import (
    FOLLOW_JOINT_TRAJECTORY,
    GATEWAY,
    GATEWAY_INPUTS,
    GRIPPER_COMMAND,
    TOPICS,
    Delivery,
    Topic,
)
from gemelo.services.stepper_gateway.core import GatewayCore
from gemelo.services.stepper_gateway.inputs import BeganInput, Given, Input, ParametersInput, Reply, digest_of, unpacked
from gemelo.services.stepper_gateway.outputs import GoalFinished, GripperFinished, Output, Publish, SendFrame
from gemelo.services.stepper_gateway.parameters import ALL_STATES, GatewayParameters
from gemelo.tools.replay.comparison import ABSENT, Comparison
from gemelo.tools.replay.recorded import AGAIN, Heard, NotReplayable, Recorded

SAID = tuple(
    topic for topic in recorded_topics() if topic in TOPICS and topic.writer == GATEWAY and topic is not GATEWAY_INPUTS
)
ENDED = {action.key: action_topics(action)[3] for action in (FOLLOW_JOINT_TRAJECTORY, GRIPPER_COMMAND)}
TOPICS_REPLAYED = (GATEWAY_INPUTS, *SAID, *ENDED.values())
OTHERS = "frames, results, answers and log lines"  # the outputs of one input that are not for the bus
UNRECORDED = "messages before the recorder listened, after its end, or of a LATEST topic that it was not given"
OUTSIDE = "recorded messages from before the core began, or after its last input that was kept"
EARLIER = "messages of device/inputs of a stepper_gateway that began before the recording: its state is not known"
CHECKSUMS = f"{OTHERS} with another checksum, which knows no tolerance"
LATE = 1_000_000_000  # [ns] after which a message that was recorded must have been said again
AHEAD = 256  # recorded messages among which a replayed one is looked for


def replay(recorded: Recorded, comparison: Comparison) -> None:
    """Compares until the first difference, or the end of the inputs."""
    again = GatewayAgain(recorded, comparison)
    for at, given in again.inputs():
        again.give(at, given)
        if comparison.difference is not None:
            return
    again.end()


class GatewayAgain:
    """The gateway's core, and the recorded messages beside which its own are held."""

    def __init__(self, recorded: Recorded, comparison: Comparison) -> None:
        self._recorded, self._comparison = recorded, comparison
        self._arm: ArmDescription = recorded.arm()
        self._core: GatewayCore | None = None
        self._count, self._last = 0, 0  # of the inputs; [ns] of the last
        self._ended = {
            (key, heard.message.goal_id): (topic, heard) for key, topic in ENDED.items() for heard in recorded.of(topic)
        }
        self._said = {topic.key: TopicMessages(topic, recorded.of(topic), comparison) for topic in SAID}

    def inputs(self) -> Iterator[tuple[float, Given]]:
        """Each input with its time [s] in the recording, from the first beginning of a core on.

        Of a core that began before the recording, or whose beginning is not in it, nothing can be said.
        """
        before: GatewayInputs | None = None
        for heard in self._from_the_first_beginning():
            message = heard.message
            follows = before is not None and message.session == before.session
            expected = before.number + 1 if before is not None and follows else 0
            if message.number != expected:
                came = f"after {expected - 1} comes {message.number}" if follows else (
                    f"those of a new process begin with {message.number}")  # fmt: skip
                raise NotReplayable(
                    f"{self._recorded.path}: {GATEWAY_INPUTS.key} number {expected} is missing at {heard.at:.3f} s "
                    f"({came}): inputs were lost, or record_inputs was off; take another recording"
                )
            before = message
            for given in self._unpacked(heard):
                yield self._recorded.at(given.unix), given

    def _from_the_first_beginning(self) -> Iterator[Heard[GatewayInputs]]:
        """The messages but for those of a core that began before the recording."""
        all_inputs = self._recorded.require(GATEWAY_INPUTS)
        begins = next((place for place, heard in enumerate(all_inputs) if heard.message.number == 0), None)
        if begins is None:
            raise NotReplayable(
                f"{self._recorded.path}: it begins in the middle of the gateway's life (its {GATEWAY_INPUTS.key} are "
                f"number {all_inputs[0].message.number} to {all_inputs[-1].message.number}; number 0, with which the "
                "core begins, is in an earlier file), so the state of its core is not known, and stepper_gateway is "
                "not started anew in it: replay the file in which it starts, or restart stepper_gateway while it is "
                "recorded, with its parameter record_inputs on"
            )
        self._comparison.aside[EARLIER] += begins
        return iter(all_inputs[begins:])

    def give(self, at: float, given: Given) -> None:
        """One input, `at` [s]."""
        self._count, self._last = self._count + 1, given.unix
        if isinstance(given.input, BeganInput):
            self._begin(given.unix, given.input)
            return
        if isinstance(given.input, ParametersInput):
            given = replace(given, input=ParametersInput(self._as_they_were(given.input.parameters)))
        assert self._core is not None  # the first message begins with `BeganInput`
        try:
            reply, outputs = self._core.handle(given.input, given.moment)
        except Exception as error:
            self._differ(at, given.input, given.digest, f"the core ends by {type(error).__name__}: {error}")
            return
        if not all(self._hold(given.unix, at, output) for output in outputs):
            return
        if digest_of(reply, outputs) == given.digest:
            self._comparison.alike[OTHERS] += any(not isinstance(each, Publish) for each in outputs)
        elif self._comparison.tolerance:
            self._comparison.aside[CHECKSUMS] += 1
        else:
            self._differ(at, given.input, given.digest, _in_words(reply, outputs))

    def _hold(self, unix: int, at: float, output: Output) -> bool:
        """False where a recorded message is another."""
        match output:
            case Publish(topic, message):
                return self._said[topic.key].hold(unix, at, message)
            case GoalFinished():
                return self._hold_end(FOLLOW_JOINT_TRAJECTORY.key, output)
            case GripperFinished():
                return self._hold_end(GRIPPER_COMMAND.key, output)
        return True

    def _hold_end(self, action: str, output: GoalFinished | GripperFinished) -> bool:
        """Status and result; stamp and client are the action server's, which no core knows."""
        if (action, output.goal_id) not in self._ended:
            return True
        topic, heard = self._ended[action, output.goal_id]
        was = heard.message
        return self._comparison.hold(topic.key, heard, was, replace(was, status=output.status, result=output.result))

    def end(self) -> None:
        """Holds what is left of the recorded messages against the last input."""
        for said in self._said.values():
            said.end(self._last)

    def _begin(self, unix: int, began: BeganInput) -> None:
        self._began = began
        self._core = GatewayCore(self._arm, began.session, self._as_they_were(began.parameters), began.kept)
        for said in self._said.values():
            said.begin(unix)

    def _as_they_were(self, parameters: GatewayParameters) -> GatewayParameters:
        """A core of before `rest_rate` published every state, one of before `readings_rest_rate` every reading; one of
        before `watch_streams` watched none."""
        if not self._began.has_watch:
            parameters = replace(parameters, watch_streams=False)
        if not self._began.has_rest_rate:
            parameters = replace(parameters, rest_rate=ALL_STATES)
        return parameters if self._began.has_readings_rest_rate else replace(parameters, readings_rest_rate=ALL_STATES)

    def _differ(self, at: float, given: Input, digest: int, now: str) -> None:
        was = f"others (BLAKE2 {digest:016x})" if digest else ABSENT
        path = f"outputs of {given.__struct_config__.tag}"
        self._comparison.differ(OTHERS, self._count - 1, at, path, was, now)

    def _unpacked(self, heard: Heard[GatewayInputs]) -> list[Given]:
        try:
            return list(unpacked(heard.message.inputs))
        except ValueError as error:
            raise NotReplayable(
                f"{self._recorded.path}: {GATEWAY_INPUTS.key} number {heard.message.number} cannot be read here: "
                f"{error}; {AGAIN}"
            ) from error


class TopicMessages:
    """The recorded messages of one topic, in order."""

    def __init__(self, topic: Topic[Any], heard: list[Heard[Any]], comparison: Comparison) -> None:
        self._topic, self._heard, self._comparison = topic, heard, comparison
        self._next = 0
        self._has_begun = False  # one of its messages has been found since the core began
        self._unmatched: Message | None = None  # the first replayed one since then that no recorded one has been like

    def begin(self, unix: int) -> None:
        """Another core: what came before `unix` [ns] was of none that is replayed."""
        self._has_begun, self._unmatched = False, None
        while self._next < len(self._heard) and self._heard[self._next].arrival < unix:
            self._next += 1
            self._comparison.aside[OUTSIDE] += 1

    def hold(self, unix: int, at: float, message: Message) -> bool:
        """False at a difference; `message` was said at `unix` [ns], `at` [s] into the recording."""
        place = self._place_of(message)
        if place is None:
            return self._is_unrecorded(at, message) and not self._is_overdue(unix)
        if place > self._next:  # the replay has not said what was recorded before
            return self._missing()
        heard = self._heard[place]
        self._next, self._has_begun, self._unmatched = place + 1, True, None
        return self._comparison.hold(self._topic.key, heard, heard.message, message)

    def end(self, unix: int) -> None:
        """What was recorded until `unix` [ns], the last input, has to have been said."""
        if not self._is_overdue(unix + LATE):
            self._comparison.aside[OUTSIDE] += len(self._heard) - self._next

    def _place_of(self, message: Message) -> int | None:
        """Where the next recorded message of the same stamp is."""
        stamp = message.stamp  # type: ignore[attr-defined]  # every message of the gateway has one
        for place in range(self._next, min(self._next + AHEAD, len(self._heard))):
            if self._heard[place].stamp == stamp:
                return place
        return None

    def _is_unrecorded(self, at: float, message: Message) -> bool:
        """True if a recorder may lack it: at its beginning and end, and of a LATEST topic."""
        self._unmatched = self._unmatched or message
        is_over = self._next >= len(self._heard)
        if is_over or not self._has_begun or self._topic.delivery is Delivery.LATEST:
            self._comparison.aside[UNRECORDED] += 1
            return True
        self._comparison.differ(self._topic.key, -1, at, "", ABSENT, message)
        return False

    def _is_overdue(self, unix: int) -> bool:
        """True if a message was recorded so long before `unix` [ns] that the replay must have said it by now."""
        if self._next >= len(self._heard) or self._heard[self._next].arrival >= unix - LATE:
            return False
        return not self._missing()

    def _missing(self) -> bool:
        """False: the next recorded message is another than the one that was said in its place, or there is none."""
        lost = self._heard[self._next]
        return self._comparison.hold(self._topic.key, lost, lost.message, self._unmatched)


def _in_words(reply: Reply, outputs: list[Output]) -> str:
    """What the core has said now, but for the messages for the bus."""
    said = [repr(reply)] if reply is not None else []
    said += [repr(each) for each in outputs if not isinstance(each, Publish | SendFrame)]
    said += [f"frame {each.kind} of {len(each.payload)} B" for each in outputs if isinstance(each, SendFrame)]
    return ", ".join(said) or ABSENT
