"""The virtual ESP32's quartz: device time against real time, which may run fast."""

from __future__ import annotations


class DeviceClock:
    """Device time [us], continuous, of real time [s]; exact until somebody lets it drift."""

    def __init__(self, real: float, device_us: int = 0) -> None:
        self._real, self._device_us, self._ppm = real, float(device_us), 0.0

    def at(self, real: float) -> int:
        """Device time at that real time; never below zero."""
        return max(0, int(self._exact(real)))

    def drift(self, real: float, ppm: float) -> None:
        """From now on the clock is fast by `ppm`."""
        self._device_us, self._real, self._ppm = self._exact(real), real, ppm

    def restart(self, real: float) -> None:
        """Count from zero again; the quartz is the same."""
        self._real, self._device_us = real, 0.0

    def _exact(self, real: float) -> float:
        return self._device_us + (real - self._real) * (1e6 + self._ppm)
