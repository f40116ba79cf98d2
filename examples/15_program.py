"""Teach two points, write a program of them, check it whole, and run it."""

from tempfile import TemporaryDirectory

import gemelo
from gemelo.programs import Go, Points, Program, ProgramRun, Programs, Repeat, Speed, check_program

STEPS = (
    Speed(share=0.8),
    Repeat(count=2, steps=(Go(point="one"), Go(point="two", blend=0.02), Go(state="ready"))),
)

with gemelo.connect() as arm, TemporaryDirectory() as folder:
    points, programs = Points.load(folder, arm.description), Programs(folder)
    for name, state in (("one", "left"), ("two", "right")):
        points.remember(name, arm.plan(named=state).end)  # or where it has been led by hand: arm.joints
    program = Program("there and back", STEPS)
    print(program.save(folder).read_text())
    check = check_program(arm, program, points, programs)
    for leg in check.legs:
        joint, margin = leg.tightest
        print(f"{leg.text}: {leg.duration:.2f} s, {leg.times} times, {margin:.0%} of {joint} are left")
    run = ProgramRun(arm, program, points, programs)
    run.start()
    ended = run.wait()
    print(f"{ended.status}: {ended.done} steps, {check.duration:.1f} s planned")
