"""Stand-in for lerobot.teleoperators: the base classes of teleoperators."""

from __future__ import annotations

import abc
from dataclasses import dataclass
from pathlib import Path

from lerobot.registry import ChoiceRegistry


@dataclass(kw_only=True)
class TeleoperatorConfig(ChoiceRegistry, abc.ABC):
    id: str | None = None
    calibration_dir: Path | None = None

    @property
    def type(self) -> str:
        return self.get_choice_name(type(self))


class Teleoperator(abc.ABC):
    config_class: type
    name: str

    def __init__(self, config: TeleoperatorConfig) -> None:
        self.id = config.id
        assert config.calibration_dir is not None, "in tests a folder of the test's: LeRobot writes into the home"
        self.calibration_dir = config.calibration_dir
        self.calibration_dir.mkdir(parents=True, exist_ok=True)

    def __str__(self) -> str:
        return f"{self.id} {type(self).__name__}"

    @property
    @abc.abstractmethod
    def action_features(self) -> dict: ...

    @property
    @abc.abstractmethod
    def feedback_features(self) -> dict: ...

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
    def get_action(self) -> dict: ...

    @abc.abstractmethod
    def send_feedback(self, feedback: dict) -> None: ...

    @abc.abstractmethod
    def disconnect(self) -> None: ...
