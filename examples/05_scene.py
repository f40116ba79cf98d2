"""Puts a post into the way: the plan goes around it, and the scene is left as it was found."""

import gemelo

with gemelo.connect() as arm, arm.scene.restored():
    arm.move(named="left")
    left, ready = arm.states["left"], arm.states["ready"]
    between = arm.fk({name: (left[name] + ready[name]) / 2 for name in left})
    print("without the post:", arm.plan(named="ready").planner)
    arm.scene.add_box("post", size=(0.03, 0.03, 0.1), at=between.position)
    print("with the post:", arm.plan(named="ready", seed=1).planner)
    print(arm.move(named="ready", seed=1))
