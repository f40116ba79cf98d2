"""The meshes of a planning scene apart from it: the scene names each by its digest, and its file has a key of its own.

So a scene stays small however large its meshes are, and a file crosses the bus once and not with every change.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from functools import lru_cache

from msgspec.structs import replace

from gemelo.schemas.scene import (
    MeshShape,
    PlanningScene,
    SceneAdd,
    SceneEdit,
    SceneObject,
    SceneReplace,
    SceneResize,
    Shape,
)

DIGEST_BYTES = 16  # chosen: two files have the same one by chance in 2^64


@lru_cache(maxsize=64)
def mesh_digest(content: bytes) -> str:
    """The name of a file by its content, in hexadecimal digits."""
    return hashlib.blake2b(content, digest_size=DIGEST_BYTES).hexdigest()


def meshes_in(scene: PlanningScene) -> dict[str, bytes]:
    """The files that the scene itself carries, by their digests."""
    shapes = [item.shape for item in scene.objects if isinstance(item.shape, MeshShape)]
    return {mesh_digest(shape.data): shape.data for shape in shapes if shape.data and not shape.path}


def digests_in(scene: PlanningScene) -> frozenset[str]:
    """The digests of the files that the scene names and does not carry."""
    shapes = [item.shape for item in scene.objects if isinstance(item.shape, MeshShape)]
    return frozenset(shape.digest for shape in shapes if shape.digest and not shape.path and not shape.data)


def by_digest(scene: PlanningScene) -> PlanningScene:
    """The scene with a digest in place of each file that it carries."""
    return _with_shapes(
        scene,
        lambda shape: (
            replace(shape, data=b"", digest=mesh_digest(shape.data), size=len(shape.data)) if shape.data else shape
        ),
    )


def with_meshes(scene: PlanningScene, contents: Mapping[str, bytes]) -> PlanningScene:
    """The scene with those of the files in place of their digests that are in `contents`."""
    return _with_shapes(scene, lambda shape: filled(shape, contents))


def edit_with_meshes(edit: SceneEdit, contents: Mapping[str, bytes]) -> SceneEdit:
    """As `with_meshes`, of a change of the scene."""
    match edit:
        case SceneAdd(object=item):
            return replace(edit, object=_with_shape(item, lambda shape: filled(shape, contents)))
        case SceneResize(shape=MeshShape() as shape):
            return replace(edit, shape=filled(shape, contents))
        case SceneReplace(scene=scene):
            return replace(edit, scene=with_meshes(scene, contents))
    return edit


def filled(shape: MeshShape, contents: Mapping[str, bytes]) -> MeshShape:
    """The shape with its file, if that is in `contents`."""
    if shape.path or shape.data or shape.digest not in contents:
        return shape
    return replace(shape, data=contents[shape.digest], digest="", size=0)


def _with_shapes(scene: PlanningScene, change: Callable[[MeshShape], Shape]) -> PlanningScene:
    objects = tuple(_with_shape(item, change) for item in scene.objects)
    same = all(one is other for one, other in zip(objects, scene.objects, strict=True))
    return scene if same else replace(scene, objects=objects)


def _with_shape(item: SceneObject, change: Callable[[MeshShape], Shape]) -> SceneObject:
    if not isinstance(item.shape, MeshShape) or item.shape.path:
        return item
    shape = change(item.shape)
    return item if shape is item.shape else replace(item, shape=shape)
