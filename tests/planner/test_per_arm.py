"""The cache of what depends on an arm alone."""

from __future__ import annotations

from gemelo.services.planner.request.per_arm import once_per_arm
from gemelo.tools.bench.scenes import parol6, rm1


def test_the_result_is_kept_until_another_arm_is_asked_about():
    asked: list[str] = []

    @once_per_arm
    def name(arm):
        asked.append(arm.name)
        return arm.name

    first, second = rm1(), parol6()
    assert [name(first), name(first), name(second), name(first)] == [first.name, first.name, second.name, first.name]
    assert asked == [first.name, second.name, first.name]


def test_what_is_made_of_an_arm_and_its_limits_is_kept_as_long_as_both_are_the_same_objects():
    asked: list[float] = []

    @once_per_arm
    def doubled(arm, limits):
        asked.append(limits[0])
        return [2.0 * limit for limit in limits]

    arm, limits, equal = rm1(), [1.0], [1.0]
    assert doubled(arm, limits) is doubled(arm, limits)
    assert doubled(arm, equal) == [2.0]
    assert asked == [1.0, 1.0]
