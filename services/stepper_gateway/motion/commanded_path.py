"""The path that was sent along one stream: the command at any played instant, exactly.

Where chunks replace what comes behind one of its knots, it has versions. The device's word which chunk it wants next
says which of them it has: an accepted replacement lies behind the point of every state that does not know it.
"""

from __future__ import annotations

from gemelo.services.stepper_gateway.motion.knots import Knot, StepKnot
from gemelo.services.stepper_gateway.motion.path_version import PathPoint, PathVersion

KEPT = 256  # knots behind the played one that are kept; chosen: 5 s, longer than a state is under way
PRUNED_AT = 1024  # how many may gather before pruning; chosen: so pruning costs little for each knot
LIMBO = 64  # versions that the device may still have taken; chosen: beyond what can be under way
ALL = 1 << 62  # as the next chunk that the device wants: it has all of them; chosen: beyond every sequence number


class CommandedPath:
    """The knots of a stream by stream time; cubic Hermite between them, as the device plays them."""

    def __init__(self) -> None:
        self._versions: list[PathVersion] = [PathVersion(0)]
        self._limbo: dict[int, PathVersion] = {}  # that the device has not taken, as it seems, by their chunk

    def append(self, time_us: int, steps: StepKnot, knot: Knot, braking: float) -> None:
        """`braking` [s] is how long the arm takes from the knot to rest."""
        self.newest.append(time_us, steps, knot, braking)

    def replace(self, version: PathVersion) -> None:
        """From its first knot on the path is another one; a first version is the whole of it."""
        if not self.newest.times:
            self._versions.clear()
        self._versions.append(version)

    @property
    def newest(self) -> PathVersion:
        """As the device has it, if all that was sent arrives and is taken."""
        return self._versions[-1]

    @property
    def end_us(self) -> int:
        return self.newest.times[-1] if self.newest.times else 0

    @property
    def last(self) -> Knot:
        return self.newest.knots[-1]

    @property
    def last_steps(self) -> StepKnot:
        return self.newest.steps[-1]

    def knots_between(self, from_us: int, to_us: int) -> list[Knot]:
        """The knots from the one at or before `from_us` to the one at or before `to_us`."""
        parts = self._parts(from_us)
        return [knot for version, end in parts for knot in version.knots[version.span(from_us, min(to_us, end))]]

    def count_between(self, from_us: int, to_us: int) -> int:
        """How many `knots_between` has."""
        return len(self.knots_between(from_us, to_us))

    def longest_braking(self, from_us: int, to_us: int) -> float:
        """[s] the longest that braking from one of `knots_between` to rest takes; 0 for none."""
        return max(version.longest_braking(from_us, min(to_us, end)) for version, end in self._parts(from_us))

    def upcoming(self, from_us: int) -> list[tuple[int, Knot]]:
        """Stream times [us] and knots, from the one at or before `from_us` to the last."""
        found: list[tuple[int, Knot]] = []
        for version, end in self._parts(from_us):
            part = version.span(from_us, end)
            found += zip(version.times[part], version.knots[part], strict=True)
        return found

    def at(self, time_us: int, next_seq: int = ALL) -> PathPoint:
        """The commanded path [steps] at `time_us` [us] of the stream, held at its ends, of a device that wants the
        chunk `next_seq` next."""
        return self._version_at(time_us, next_seq).at(time_us)

    def forget(self, first: int, last: int) -> None:
        """The device has not taken these chunks, as it seems, and so takes none that goes on from their knots."""
        gone = [version for version in self._versions[1:] if first <= version.seq <= last]
        if gone:
            from_us = min(version.times[0] for version in gone)
            gone += [v for v in self._versions[1:] if v.seq > last and v.times[0] > from_us]
        self._versions = [version for version in self._versions if version not in gone]
        self._limbo |= {version.seq: version for version in gone}
        while len(self._limbo) > LIMBO:
            del self._limbo[next(iter(self._limbo))]

    def revive(self, seq: int) -> None:
        """The device has taken that chunk after all."""
        if (version := self._limbo.pop(seq, None)) is not None:
            self._versions = sorted((*self._versions, version), key=lambda each: each.seq)

    def prune(self, played_us: int, next_seq: int = ALL) -> None:
        """Forget what was played long ago: no later state is of a version before that of this one."""
        oldest = self._version_at(played_us, next_seq)
        if oldest is not self._versions[0]:
            del self._versions[: self._versions.index(oldest)]
            self._limbo = {seq: version for seq, version in self._limbo.items() if seq > oldest.seq}
        if len(oldest.times) > PRUNED_AT:
            oldest.prune(played_us, KEPT)

    def _version_at(self, time_us: int, next_seq: int) -> PathVersion:
        for version in reversed(self._versions):
            if version.seq < next_seq and version.times and version.times[0] <= time_us:
                return version
        return self._versions[0]

    def _parts(self, from_us: int) -> list[tuple[PathVersion, int]]:
        """The versions that the path is made of from `from_us` [us] on, each with the last time [us] of its own."""
        parts: list[tuple[PathVersion, int]] = []
        end = ALL
        for version in reversed(self._versions):
            begin = version.times[0] if version.times else 0
            if begin < end:
                parts.append((version, end - 1))
                end = begin
            if begin <= from_us:
                break
        return parts[::-1]
