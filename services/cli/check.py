"""`gemelo check`: what is wrong with a robot's folder, and what to do about it."""

from __future__ import annotations
