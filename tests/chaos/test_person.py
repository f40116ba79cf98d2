"""The person beside the arm in chaos: the steps by hand, and those that only wait."""

from types import SimpleNamespace
from typing import Any

import pytest

from gemelo import DeviceMode
from gemelo.schemas.device import DeviceConfiguration
from gemelo.tools.chaos.person import Person

SILENT = 'device "rm1" is silent for more than 0.5 s: check its power and network'


class StandIn:
    """An arm whose device says one configuration after the other, and takes what it is given."""

    def __init__(self, *said: DeviceConfiguration) -> None:
        self._said = list(said)
        self.device: Any = self
        self.node = SimpleNamespace(latest=lambda topic: SimpleNamespace(message=None), subscribe=lambda *_: None)
        self.mode, self.state = DeviceMode.IDLE, SimpleNamespace(armed=True)

    @property
    def configuration(self) -> DeviceConfiguration:
        return self._said.pop(0) if len(self._said) > 1 else self._said[0]

    def configure(self) -> None:
        self._said = [DeviceConfiguration(crc32=7, device_crc32=7, accepted=True)]

    def wait_for(self, condition: object, seconds: float) -> bool:
        return False


@pytest.mark.parametrize(
    ("device_crc32", "hands"), [(7, []), (9, ["configure"])], ids=["silent for a moment", "with another configuration"]
)
def test_a_device_is_configured_by_hand_only_where_it_has_another_configuration(device_crc32, hands):
    silent = DeviceConfiguration(crc32=7, device_crc32=device_crc32, accepted=False, reason=SILENT)
    person = Person(StandIn(silent, silent, DeviceConfiguration(crc32=7, device_crc32=7, accepted=True)))
    assert person.make_ready(5.0, reference=False) is None
    assert person.hands == hands
