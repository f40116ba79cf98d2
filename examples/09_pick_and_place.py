"""Grips a part and carries it around a post, on whichever arm is running; the scene is left as it was found."""

import gemelo

FROM, TO = "left", "ready"  # named states of both arms in which the tool looks down
LIFT, GAP = 0.03, 0.006  # [m] that the part is lifted; from the part to the tool, more than the planner's clearance
PART, STAND, POST = (0.02, 0.02, 0.02), (0.05, 0.05, 0.01), (0.03, 0.03, 0.1)  # [m] edges


def say(what: str, motion: gemelo.Motion) -> None:
    lost = sum(abs(a - b) for a, b in zip(motion.result.commanded_steps, motion.result.executed_steps, strict=True))
    print(f"{what}: {motion.plan.planner}, {motion.plan.duration:.2f} s, {lost} steps lost", flush=True)


with gemelo.connect() as arm, arm.scene.restored():
    first, last = arm.states[FROM], arm.states[TO]
    pick, place = arm.fk(first), arm.fk(last)
    between = arm.fk({name: (first[name] + last[name]) / 2 for name in first})
    arm.scene.add_box("post", POST, at=between.position)  # in the middle of the straight path
    arm.scene.add_box("part", PART, at=pick.offset(z=-LIFT - GAP - PART[2] / 2).position)
    for name, pose in (("pick_stand", pick), ("place_stand", place)):
        arm.scene.add_box(name, STAND, at=pose.offset(z=-LIFT - GAP - PART[2] - STAND[2] / 2).position)
        arm.scene.allow("part", name)

    print(f"open: {arm.grip('open')}", flush=True)
    say("above the part", arm.move(pose=pick))
    say("down", arm.line(pose=pick.offset(z=-LIFT), speed=0.05))
    print(f"close: {arm.grip('close')}", flush=True)
    say("up", arm.line(pose=pick, speed=0.05))
    say("around the post", arm.move(pose=place))
    say("down", arm.line(pose=place.offset(z=-LIFT), speed=0.05))
    print(f"open: {arm.grip('open')}", flush=True)
    say("up", arm.line(pose=place, speed=0.05))
    say("home", arm.move(named="home"))
