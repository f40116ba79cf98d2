"""A node: prints the joints twice a second, and says so when they fall silent."""

from gemelo import Node, topics

with Node("joint_monitor") as node:
    joints = node.latest(topics.JOINT_STATES)

    def show(now: int) -> None:
        if joints.message is None or joints.is_stale:
            print("no joint states: is stepper_gateway running?", flush=True)
            return
        state = joints.message
        print("  ".join(f"{name} {at:+.4f}" for name, at in zip(state.name, state.position, strict=True)), flush=True)

    node.wait(0.3)  # for the first of them
    node.spin(show, rate=2.0)
