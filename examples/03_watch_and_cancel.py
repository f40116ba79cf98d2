"""Starts a move, watches it for a while, and cancels it: the arm decelerates on its path."""

import time

import gemelo

with gemelo.connect() as arm:
    arm.move(named="home")
    motion = arm.start(named="left", speed=0.3)
    while motion.progress < 0.3:
        print(f"{motion.progress:.0%}", flush=True)
        time.sleep(0.2)
    motion.cancel()
    print(motion.wait())
    print("it stands at", {name: round(at, 3) for name, at in motion.stopped_at.items()})
