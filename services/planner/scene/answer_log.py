"""Log of the inputs of answers, published beside them: enough for `gemelo replay` to make the same answers again."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

from gemelo.libraries.runtime.node import Node
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import AnswerInputs, SceneVersion
from gemelo.schemas.topics import ANSWER_INPUTS, Request


class AnswerLog:
    """Numbers the answers of each request; `is_on` says if they are published. Any thread, always the same for one."""

    def __init__(self, node: Node, is_on: Callable[[], bool]) -> None:
        self._node, self._is_on = node, is_on
        self._inputs = node.publisher(ANSWER_INPUTS)
        self._answers: Counter[str] = Counter()

    def tell(
        self, request: Request[Any, Any], stamp: int, present: JointState | None, age: float, scene: SceneVersion
    ) -> None:
        """To be called once for each answer, before it is given; `age` [s] is of `present`, `stamp` [ns] UNIX."""
        self._answers[request.key] += 1
        if not self._is_on():
            return
        inputs = AnswerInputs(
            stamp=stamp,
            request=request.key,
            number=self._answers[request.key],
            present=present,
            age=age if present is not None else 0.0,  # infinite before the first state
            scene=scene,
        )
        self._node.post(lambda: self._inputs.put(inputs))
