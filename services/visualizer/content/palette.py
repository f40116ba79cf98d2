"""The colours of the view: measured is solid and warm, commanded is light and blue."""

from __future__ import annotations

Color = tuple[int, int, int]
Rgba = tuple[int, int, int, int]

ARM = (198, 202, 208)  # links whose URDF names no colour
GHOST = (86, 156, 255, 60)
EXECUTED = (255, 122, 48)
COMMANDED = (122, 180, 255)
ERROR = (255, 122, 48)
BAND = (240, 190, 60)
JOINTS = ((255, 122, 48), (122, 180, 255), (120, 220, 150), (235, 120, 190), (180, 150, 250), (230, 215, 110))
PATH = (90, 235, 225)
TRAIL = (255, 122, 48)
SHAFT = (186, 130, 250)
OBJECT = (156, 150, 128, 150)
ATTACHED = (120, 200, 170, 190)
IN_CONTACT = (235, 60, 60, 190)
REFUSED_ARM = (210, 214, 222, 45)  # the arm where a plan was refused
PLANNED = (90, 235, 225, 80)  # the arm as it would go
LABEL = (255, 120, 110)
FOUND = (120, 255, 120)  # what a detector has found
FRUSTUM = (240, 200, 90)
GRID = (140, 148, 160, 50)
BACKGROUND = (22, 25, 30)

MODES = {
    "OFFLINE": (110, 110, 110), "WAITING": (110, 110, 110), "BOOT": (150, 150, 150), "UNREFERENCED": (222, 170, 60),
    "HOMING": (170, 130, 230), "IDLE": (84, 160, 110), "RUN": (86, 156, 255), "HOLD": (240, 190, 60),
    "FAULT": (230, 70, 70), "ESTOP": (230, 70, 70),
}  # fmt: skip

# The arm itself in these modes: seen from across the room.
TINTS: dict[str, Color] = {"FAULT": (214, 48, 48), "ESTOP": (214, 48, 48), "OFFLINE": (96, 98, 102)}
