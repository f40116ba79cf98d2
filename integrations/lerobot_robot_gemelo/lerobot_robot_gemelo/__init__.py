"""Arms of gemelo in LeRobot: `--robot.type=gemelo` and `--teleop.type=gemelo`.

LeRobot imports every distribution whose name begins with lerobot_robot_, by which both types become known to it.
"""

from .config_gemelo import GemeloConfig, GemeloTeleopConfig
from .robot import Gemelo
from .teleoperator import GemeloTeleop

__all__ = ["Gemelo", "GemeloConfig", "GemeloTeleop", "GemeloTeleopConfig"]
