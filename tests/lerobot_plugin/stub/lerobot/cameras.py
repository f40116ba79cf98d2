"""Stand-in for lerobot.cameras: the configuration of cameras, and one camera of a test's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lerobot.registry import ChoiceRegistry, make_device_from_device_class


@dataclass(kw_only=True)
class CameraConfig(ChoiceRegistry):
    fps: int | None = None
    width: int | None = None
    height: int | None = None


@dataclass(kw_only=True)
class GreyConfig(CameraConfig):
    """A camera that sees nothing but grey."""


class Grey:
    def __init__(self, config: GreyConfig) -> None:
        self.fps, self.width, self.height = config.fps, config.width, config.height
        self.is_connected = False

    def connect(self, warmup: bool = True) -> None:
        self.is_connected = True

    def read_latest(self, max_age_ms: int = 500) -> np.ndarray:
        assert self.is_connected
        return np.full((self.height, self.width, 3), 127, np.uint8)

    def disconnect(self) -> None:
        self.is_connected = False


def make_cameras_from_configs(configs: dict[str, CameraConfig]) -> dict[str, Any]:
    return {name: make_device_from_device_class(config) for name, config in configs.items()}
