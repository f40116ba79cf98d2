"""The gateway's core keeps no more after many moves than after few: everything that it remembers is bounded."""

from __future__ import annotations

import gc
import types

from gemelo.tools.virtual_arm.virtual_arm import VirtualArm
from tests.stepper_gateway.harness import move

PLACES = ((0.0, 0.0, 0.0), (0.2, 0.1, 0.02), (0.1, 0.25, 0.01))
WARM_UP, MOVES = 12, 36
NOT_KEPT = (type, types.ModuleType, types.FunctionType, types.BuiltinFunctionType, types.MethodType, types.CodeType)


def objects_of(root: object) -> int:
    """How many objects can be reached from `root`, without code."""
    seen, waiting = {id(root)}, [root]
    count = 0
    while waiting:
        count += 1
        for each in gc.get_referents(waiting.pop()):
            if id(each) not in seen and not isinstance(each, NOT_KEPT):
                seen.add(id(each))
                waiting.append(each)
    return count


def test_what_the_core_keeps_does_not_grow_with_the_moves_that_it_has_made() -> None:
    rig = VirtualArm().ready()
    counts: list[int] = []
    for number in range(WARM_UP + MOVES):
        name = f"move {number}"
        goal = tuple(a + 1e-4 * number for a in PLACES[number % len(PLACES)])  # no two places are the same
        verdict = rig.goal(move(rig.position, goal), name)
        assert verdict.accepted, verdict.reason
        rig.finish(name)
        rig.run(0.3)
        counts.append(objects_of(rig.core))
    early, late = counts[WARM_UP : WARM_UP + MOVES // 2], counts[WARM_UP + MOVES // 2 :]
    assert max(late) - max(early) < 5 * MOVES, (early, late)  # a message that is kept is more than ten objects
