"""The cache of what depends on an arm alone."""

from __future__ import annotations

from services.bench.scenes import parol6, rm1
from services.planner.request.per_arm import once_per_arm


def test_the_result_is_kept_until_another_arm_is_asked_about():
    asked: list[str] = []

    @once_per_arm
    def name(arm):
        asked.append(arm.name)
        return arm.name

    first, second = rm1(), parol6()
    assert [name(first), name(first), name(second), name(first)] == [first.name, first.name, second.name, first.name]
    assert asked == [first.name, second.name, first.name]
