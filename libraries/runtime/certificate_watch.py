"""The end of the certificate that a process was started with: said at its start, and daily in the last month."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from gemelo.libraries.credentials.expiry import ending, expiry
from gemelo.libraries.credentials.private_files import AccessError

PERIOD = 86_400.0  # [s] between two looks
RENEWAL = "`gemelo deploy keys` renews it, then give this host its folder again and start this process anew"


class CertificateWatch:
    """Says when the end is near; `beat` may be called as often as one likes."""

    def __init__(
        self,
        certificate: str,
        warn: Callable[[str], object],
        remedy: str = RENEWAL,
        now: Callable[[], float] = time.time,
    ) -> None:
        """`certificate` is the file, empty for a process that shows none; `now` gives [s] UNIX time."""
        self._certificate, self._warn, self._remedy, self._now = certificate, warn, remedy, now
        self.ends = _expiry(certificate)  # [s] UNIX time; None: it shows none, or one that cannot be read
        self._next = -1.0  # [s] UNIX time of the next look

    def beat(self) -> None:
        """Looks, if a day has passed since the last time."""
        now = self._now()
        if self.ends is None or now < self._next:
            return
        self._next = now + PERIOD
        if said := ending(self.ends, now):
            self._warn(f"{self._certificate} {said}, and every link with it: {self._what_to_do(self.ends)}")

    def _what_to_do(self, ends: float) -> str:
        """A newer file is of no use to links that were opened with the old one."""
        newer = _expiry(self._certificate)
        if newer is not None and newer > ends:
            return "a newer one is there, so start this process anew, with the arm at rest"
        return self._remedy


def _expiry(certificate: str) -> float | None:
    """[s]; None where there is nothing to read, which whoever opens the links says better."""
    try:
        return expiry(Path(certificate)) if certificate else None
    except AccessError:
        return None
