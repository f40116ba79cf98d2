"""The extras of `gemelo`, by the modules that they bring and a client without any does not have."""

from __future__ import annotations

from gemelo.schemas.reasons import Reason, because

EXTRA_OF = {  # by the module's name at its top; tests/deploy/test_extras.py holds it against pyproject.toml
    "paho": "stack", "serial": "stack", "numpy": "stack", "ruckig": "stack", "rich": "stack", "cryptography": "stack",
    "psutil": "stack", "tomlkit": "stack", "yaml": "stack",
    "mcap": "record", "zstandard": "record",
    "pinocchio": "planner", "coal": "planner", "eaik": "planner", "ompl": "planner", "toppra": "planner",
    "rerun": "view", "yourdfpy": "view", "trimesh": "view", "scipy": "view", "xacro": "view",
    "viser": "panel", "cv2": "eyes", "rosbags": "ros", "xxhash": "ros",
    "pyarrow": "lerobot", "PIL": "lerobot",
}  # fmt: skip


def missing_extra(error: ModuleNotFoundError) -> Reason | None:
    """What to install where a module of an extra is not there; None for any other module."""
    module = (error.name or "").partition(".")[0]
    if module not in EXTRA_OF:
        return None
    return because("extra.missing", module=module, extra=EXTRA_OF[module])
