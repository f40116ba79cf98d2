"""Stand-in for lerobot.robots: the base classes of robots."""

from __future__ import annotations

import abc
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lerobot.registry import ChoiceRegistry


@dataclass(kw_only=True)
class RobotConfig(ChoiceRegistry, abc.ABC):
    id: str | None = None
    calibration_dir: Path | None = None

    def __post_init__(self) -> None:
        for config in (getattr(self, "cameras", None) or {}).values():
            for name in ("width", "height", "fps"):
                if getattr(config, name) is None:
                    raise ValueError(f"Specifying '{name}' is required for the camera to be used in a robot")

    @property
    def type(self) -> str:
        return self.get_choice_name(type(self))


class Robot(abc.ABC):
    config_class: type
    name: str

    def __init__(self, config: RobotConfig) -> None:
        self.robot_type = self.name
        self.id = config.id
        assert config.calibration_dir is not None, "in tests a folder of the test's: LeRobot writes into the home"
        self.calibration_dir = config.calibration_dir
        self.calibration_dir.mkdir(parents=True, exist_ok=True)
        self.calibration_fpath = self.calibration_dir / f"{self.id}.json"
        self.calibration: dict[str, Any] = {}

    def __str__(self) -> str:
        return f"{self.id} {type(self).__name__}"

    def __enter__(self):
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        self.disconnect()

    def __del__(self) -> None:
        try:
            if self.is_connected:
                self.disconnect()
        except Exception:
            pass

    @property
    @abc.abstractmethod
    def observation_features(self) -> dict: ...

    @property
    @abc.abstractmethod
    def action_features(self) -> dict: ...

    @property
    @abc.abstractmethod
    def is_connected(self) -> bool: ...

    @abc.abstractmethod
    def connect(self, calibrate: bool = True) -> None: ...

    @property
    @abc.abstractmethod
    def is_calibrated(self) -> bool: ...

    @abc.abstractmethod
    def calibrate(self) -> None: ...

    @abc.abstractmethod
    def configure(self) -> None: ...

    @abc.abstractmethod
    def get_observation(self) -> dict: ...

    @abc.abstractmethod
    def send_action(self, action: dict) -> dict: ...

    @abc.abstractmethod
    def disconnect(self) -> None: ...
