"""The figure of taking in a planning scene: from the message to worlds and obstacles that plans can be made with."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import pinocchio as pin
from msgspec.structs import replace

from gemelo.libraries.arm.kinematics.self_collisions import load_collision_geometry
from gemelo.schemas.frames import Transform
from gemelo.schemas.scene import BoxShape, CylinderShape, PlanningScene, SceneObject, SphereShape
from gemelo.services.planner.collision.scene_shapes import shape_of
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.collision_geometry.coal_shapes import geometry_of
from gemelo.services.planner.core import Planner
from gemelo.tools.bench.figures import Figure, FigureGoal, of_samples, quantile
from gemelo.tools.bench.scenes import parol6, rm1

OBJECTS, SCENES = 40, 40
GOAL = FigureGoal(median=0.5)  # [ms]
CHANGED_GOAL = 0.1  # [ms] for one object more, moved or gone


def scene_intake_ms() -> Figure:
    """Time of the CPU [ms] until a planner has another scene of 40 objects, and the native planner in it."""
    samples, naive, exact = [], [], []
    changed: dict[str, list[float]] = {"one object more": [], "one object moved": [], "one object gone": []}
    for start, arm in enumerate((rm1(), parol6())):
        planner = Planner(arm)
        take_in(planner, drawn_scene(0, OBJECTS))
        gc.freeze()  # as the planner's workers do
        for seed in range(1 + start * SCENES, 1 + (start + 1) * SCENES):
            more = drawn_scene(seed, OBJECTS + 1)
            first, *rest = more.objects
            moved = replace(more, objects=(replace(first, pose=rest[0].pose), *rest))
            fewer = replace(more, objects=more.objects[:OBJECTS])
            samples.append(cpu_ms(partial(take_in, planner, fewer)))
            for name, scene in zip(changed, (more, moved, replace(more, objects=tuple(rest))), strict=True):
                changed[name].append(cpu_ms(partial(take_in, planner, scene)))
            naive.append(cpu_ms(partial(by_pinocchio, planner, fewer)))
            exact.append(cpu_ms(partial(planner.checker.distance, arm.named_states["home"])))
            take_in(planner, PlanningScene(version=seed))
        gc.unfreeze()
    reference = {name: quantile(each, 0.5) for name, each in changed.items()}
    reference |= {
        "the first question to coal in it": quantile(exact, 0.5),
        "every pair told to pinocchio, median": quantile(naive, 0.5),
        "ratio to that": quantile(samples, 0.5) / quantile(naive, 0.5),
    }
    note = (
        f"rm1 and parol6, {OBJECTS} boxes, cylinders and spheres, none of them known before, {SCENES} scenes each; "
        f"what coal needs is made when a plan first asks it; goal of one object more, moved or gone {CHANGED_GOAL:g}"
    )
    figure = of_samples(samples, GOAL, reference, note)
    is_met = bool(figure.met) and all(reference[name] <= CHANGED_GOAL for name in changed)
    return replace(figure, met=is_met)


def take_in(planner: Planner, scene: PlanningScene) -> None:
    """As a worker does with `Show`."""
    planner.set_world(World(planner.arm, planner.kinematics, scene))
    planner.prepare()


def by_pinocchio(planner: Planner, scene: PlanningScene) -> None:
    """The plain way: the arm's shapes read, all objects added, every pair told, and the data for them made."""
    model = planner.kinematics.model
    geometry = load_collision_geometry(planner.arm, model)
    links = geometry.ngeoms
    for item in scene.objects:
        shape = shape_of(item)
        pose = pin.SE3(shape.matrix[:3, :3], shape.matrix[:3, 3])
        geometry.addGeometryObject(pin.GeometryObject(item.name, 0, 0, pose, geometry_of(shape)))
    for one in range(links):
        for other in range(one + 1, geometry.ngeoms):
            if geometry.geometryObjects[one].parentJoint != geometry.geometryObjects[other].parentJoint:
                geometry.addCollisionPair(pin.CollisionPair(one, other))
    geometry.createData()


def drawn_scene(seed: int, count: int) -> PlanningScene:
    """Boxes, cylinders and spheres around an arm that reaches about half a metre; the same ones in every run."""
    random = np.random.default_rng(seed)
    objects = []
    for index in range(count):
        angle, away, height = random.uniform((-np.pi, 0.4, 0.0), (np.pi, 0.9, 0.6)).tolist()
        size = random.uniform(0.02, 0.12, 3).tolist()
        shape = (
            BoxShape(size=tuple(size)),
            CylinderShape(radius=0.5 * size[0], length=size[2]),
            SphereShape(radius=0.5 * size[0]),
        )[index % 3]
        place = (away * float(np.cos(angle)), away * float(np.sin(angle)), height)
        objects.append(SceneObject(name=f"object {index}", shape=shape, pose=Transform(translation=place)))
    return PlanningScene(version=seed + 1, objects=tuple(objects))


def cpu_ms(work: Callable[[], object]) -> float:
    """Time of the CPU [ms] that `work` takes."""
    gc.collect()
    gc.disable()
    try:
        began = time.process_time()
        work()
        return (time.process_time() - began) * 1e3
    finally:
        gc.enable()
