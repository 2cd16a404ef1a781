"""A scene: meshes, their instances, and all of it as the one mesh that is drawn."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from umbel.errors import Error
from umbel.geometry.mesh import (
    Float64Array,
    Material,
    Mesh,
    UInt32Array,
    any_tangents,
    area_weighted_normals,
    normalized,
    uv_tangents,
)
from umbel.geometry.origin import Rounding, is_far, rounding_loss, zero_origin
from umbel.io.gltf.tree import check_tree, is_trivial, merged, owners_of, with_instances

if TYPE_CHECKING:
    from umbel.geometry.camera import Camera

_MOST_VERTICES = 0xFFFFFFFF


@dataclass
class Instance:
    """A mesh in the world."""

    mesh: int  #: index into `Scene.meshes`
    #: (4, 4) float64, mesh to world, acting on column vectors: on the mesh's origin + positions
    transform: Float64Array = field(default_factory=lambda: np.eye(4))
    name: str = ""
    node: int | None = None  #: index into the `nodes` of `Scene.tree`


@dataclass
class Scene:
    """What a file holds. Every mesh's `material_ids` index the scene's one list of materials."""

    meshes: list[Mesh] = field(default_factory=list)
    materials: list[Material] = field(default_factory=list)
    instances: list[Instance] = field(default_factory=list)
    name: str = ""
    cameras: list[Camera] = field(default_factory=list)  #: perspective ones, in the world
    #: the nodes, skins, cameras, lights, extras and copyright as glTF's JSON, without meshes
    tree: dict[str, Any] = field(default_factory=dict)

    def flatten(self) -> Mesh:
        """Everything as one mesh, as drawn: each instance transformed and appended in order.

        Mirroring transforms flip the winding, so that front faces stay in front, and the tangents'
        handedness. Where only some meshes have an attribute, the others get area-weighted
        normals, white, UV zero, or tangents along their UVs.
        """
        vertices = sum(len(self.meshes[i.mesh].positions) for i in self.instances)
        triangles = sum(len(self.meshes[i.mesh].triangles) for i in self.instances)
        if max(vertices, triangles) > _MOST_VERTICES:
            raise Error(
                f"the scene as drawn has {triangles} triangles on {vertices} vertices, more than "
                f"32-bit indices can number"
            )
        drawn = [(self.meshes[i.mesh], i.transform) for i in self.instances]
        blocks = [transformed(mesh, matrix) for mesh, matrix in drawn]
        flat = join(blocks, [(k, m.triangles, m.material_ids) for k, m in enumerate(blocks)])
        if len(blocks) != 1 or blocks[0] is not drawn[0][0]:
            flat = _far_from_zero(flat, drawn)
        materials, ids = with_default(self.materials, flat.material_ids)
        return replace(
            flat,
            material_ids=ids,
            materials=materials,
            name=self.name,
            cameras=self.cameras,
            tree=self.merged_tree(flat.origin),
            source=next((mesh.source for mesh in self.meshes if mesh.source), ""),
        )

    def merged_tree(self, origin: Float64Array) -> dict[str, Any]:
        """`tree` for all of the scene as one mesh."""
        used = {instance.mesh for instance in self.instances}
        mesh = self.mesh_notes(used.pop()) if len(used) == 1 else {}
        still = all(np.array_equal(instance.transform, np.eye(4)) for instance in self.instances)
        owners = [instance.node for instance in self.instances]
        return merged(self.tree, owners, None if still else origin, self.name, mesh)

    def stored_tree(self) -> dict[str, Any]:
        """`tree` with what says which of its nodes the meshes and instances are; {} where it says
        nothing."""
        notes = [self.mesh_notes(k) for k in range(len(self.meshes))]
        out = with_instances(self.tree, [instance.node for instance in self.instances], notes)
        return {} if is_trivial(out) else out

    def merge_loss(self) -> str:
        """What of the nodes is lost as all becomes one mesh, in words; "" where nothing is."""
        nodes = self.tree.get("nodes", [])
        drawn = list(dict.fromkeys(p.node for p in self.instances if p.node is not None))
        names = [repr(nodes[k]["name"]) for k in drawn if nodes[k].get("name")]
        listed = ", ".join([*names[:3], "..."] if len(names) > 3 else names)
        if not drawn or (len(drawn) == len(self.instances) == 1 and not names):
            return ""
        if len(self.instances) > 1:
            which = f" ({listed})" if names else ""
            used = {instance.mesh for instance in self.instances}
            notes = [self.mesh_notes(k) for k in used] if len(used) > 1 else []
            lost = {"names": "name", "extras": "extras"}
            lost = {what: key for what, key in lost.items() if any(key in note for note in notes)}
            without = f" without their {' and '.join(lost)}" if lost else ""
            return f"the meshes of its {len(drawn)} nodes{which} become one{without}"
        if np.array_equal(self.instances[0].transform, np.eye(4)):
            return ""
        return f"the mesh of its node {listed} is stored in the world's coordinates, off the node"

    def mesh_notes(self, mesh: int) -> dict[str, Any]:
        """The name and the extras that the file gives one of the meshes, as glTF's JSON."""
        one = self.meshes[mesh]
        notes = {"name": one.name if one.name != self.name else "", "extras": one.extras}
        return {key: value for key, value in notes.items() if value not in ("", None)}


def scene_of(mesh: Mesh) -> Scene:
    """A mesh as a scene, on the node of its tree that has it."""
    check_tree(mesh.tree, mesh.name or "the mesh")
    notes = (mesh.tree.get("meshes") or [{}])[0]
    tree = {key: value for key, value in mesh.tree.items() if key != "meshes"}
    owner = owners_of(tree, 1)[0]
    if "nodes" in tree:
        tree["nodes"] = [{k: v for k, v in n.items() if k != "instances"} for n in tree["nodes"]]
    named = mesh
    if notes:
        extras = notes.get("extras", mesh.extras)
        named = replace(mesh, name=str(notes.get("name") or mesh.name), extras=extras)
    drawn = [Instance(0, node=owner)]
    return Scene([named], mesh.materials, drawn, mesh.name, mesh.cameras, tree)


#: "this triangle has no material", until `with_default` gives it one.
NO_MATERIAL = 0xFFFFFFFF

Part = tuple[int, UInt32Array, UInt32Array | None]


def with_default(
    materials: list[Material], ids: UInt32Array | None, metallic: float = 1.0
) -> tuple[list[Material], UInt32Array | None]:
    """The materials, with one more for the triangles that have none where there are such: that of
    glTF, which is of metal, or another."""
    if ids is None or not (ids == NO_MATERIAL).any():
        return materials, ids
    if not materials and (ids == NO_MATERIAL).all():
        return materials, None
    ids = np.where(ids == NO_MATERIAL, np.uint32(len(materials)), ids)
    return [*materials, Material(name="default", metallic=metallic)], ids


def join(blocks: list[Mesh], parts: list[Part]) -> Mesh:
    """One mesh of the vertices of `blocks` and the triangles of `parts`, each of which is
    (index of its block, triangles, material ids). Indices beyond a block stay beyond the mesh."""
    if len(blocks) == 1 and len(parts) == 1:
        return replace(blocks[0], triangles=parts[0][1], material_ids=parts[0][2])
    if not parts:
        return Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    counts = np.array([len(b.positions) for b in blocks], np.int64)
    offsets = np.concatenate([[0], np.cumsum(counts)])
    triangles = [_shifted(t, int(counts[b]), int(offsets[b])) for b, t, _ in parts]
    blocks = _with_all_attributes(blocks, parts)
    ids = None
    if any(m is not None for _, _, m in parts):
        ids = np.concatenate(
            [np.full(len(t), NO_MATERIAL, np.uint32) if m is None else m for _, t, m in parts]
        )

    def column(attribute: str) -> np.ndarray | None:
        arrays = [getattr(b, attribute) for b in blocks]
        return None if arrays[0] is None else np.concatenate(arrays)

    far = any(b.origin.any() for b in blocks)
    return Mesh(
        np.concatenate([b.world_positions if far else b.positions for b in blocks]),
        np.concatenate(triangles),
        normals=column("normals"),
        tangents=column("tangents"),
        uvs=column("uvs"),
        colors=column("colors"),
        uv_sets=[
            np.concatenate([b.uv_sets[k] for b in blocks]) for k in range(len(blocks[0].uv_sets))
        ],
        joints=column("joints"),
        weights=column("weights"),
        material_ids=ids,
        coordinates=blocks[0].coordinates,
        rounding=_together([b.rounding for b in blocks]),
    )


def transformed(mesh: Mesh, matrix: Float64Array) -> Mesh:
    """The mesh moved by a (4, 4) matrix: normals by the inverse transpose, tangents along the
    surface, winding and handedness flipped if the matrix mirrors. Identity copies nothing.
    Positions are relative to an origin where the mesh's own are."""
    if np.array_equal(matrix, np.eye(4)):
        return mesh
    linear = np.asarray(matrix, np.float64)[:3, :3]
    with np.errstate(all="ignore"):
        mirrored = bool(np.linalg.det(linear) < 0)
        positions: NDArray[Any] = _world_points(mesh, matrix)
        rounding = _carried(mesh, matrix)
        if not mesh.origin.any():
            points, positions = positions, positions.astype(np.float32)
            rounding += rounding_loss(points, mesh.origin, positions, mesh.triangles)
        # Cofactors are the inverse transpose times the determinant, and exist where that is zero.
        cofactors = np.stack([np.cross(linear[(k + 1) % 3], linear[(k + 2) % 3]) for k in range(3)])
        normals, tangents = mesh.normals, mesh.tangents
        if normals is not None:
            normals = normalized((normals @ cofactors.T) * (-1.0 if mirrored else 1.0))
        if tangents is not None:
            along = normalized(tangents[:, :3] @ linear.T)
            w = -tangents[:, 3:] if mirrored else tangents[:, 3:]
            tangents = np.concatenate([along, w], axis=1)
    triangles = np.ascontiguousarray(mesh.triangles[:, [0, 2, 1]]) if mirrored else mesh.triangles
    return replace(
        mesh,
        positions=positions,
        origin=zero_origin(),
        triangles=triangles,
        normals=normals,
        tangents=tangents,
        rounding=rounding,
    )


def place_skins(scene: Scene, exact: dict[int, NDArray[Any]]) -> None:
    """Gives meshes that skins moved to the world (index: positions before rounding) origins,
    if the scene as a whole lies far from zero."""
    if not exact:
        return
    far = is_far(_corners(scene))
    for k, points in exact.items():
        mesh = scene.meshes[k]
        lost = rounding_loss(points, mesh.origin, mesh.positions, mesh.triangles)
        given: Any = {"positions": points} if far else {"rounding": lost}
        scene.meshes[k] = replace(mesh, **given)


def _corners(scene: Scene) -> Float64Array:
    """Least and greatest corners of all instances, approximately."""
    found: list[Float64Array] = [np.zeros((0, 3))]
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        if len(mesh.positions):
            box = np.stack([mesh.positions.min(axis=0), mesh.positions.max(axis=0)])
            corners = Mesh(box, np.zeros((0, 3), np.uint32), origin=mesh.origin)
            found.append(_world_points(corners, instance.transform))
    return np.concatenate(found)


def transformed_far(mesh: Mesh, matrix: Float64Array) -> Mesh:
    """The mesh moved by a matrix, relative to an origin where it then needs one."""
    moved = transformed(mesh, matrix)
    return mesh if moved is mesh else _far_from_zero(moved, [(mesh, matrix)])


def _far_from_zero(flat: Mesh, drawn: list[tuple[Mesh, Float64Array]]) -> Mesh:
    """What meshes make where matrices take them; their positions once more from doubles, and
    relative to an origin, if that lies far from zero."""
    if not (flat.origin.any() or is_far(flat.positions)):
        return flat
    with np.errstate(all="ignore"):
        points = np.concatenate([_world_points(mesh, matrix) for mesh, matrix in drawn])
    rounding = _together([_carried(mesh, matrix) for mesh, matrix in drawn])
    return replace(flat, positions=points, origin=zero_origin(), rounding=rounding)


def _world_points(mesh: Mesh, matrix: Float64Array) -> Float64Array:
    """Where a matrix takes the vertices, in float64."""
    linear = np.asarray(matrix, np.float64)[:3, :3]
    points: Float64Array = mesh.positions.astype(np.float64) @ linear.T + (
        linear @ mesh.origin + matrix[:3, 3]
    )
    return points


def _carried(mesh: Mesh, matrix: Float64Array) -> Rounding:
    """What the mesh has lost already, where a matrix takes it."""
    linear = np.asarray(matrix, np.float64)[:3, :3]
    if mesh.rounding.largest_move == 0 or not np.isfinite(linear).all():
        return mesh.rounding
    most = float(np.linalg.norm(linear, 2))
    return replace(mesh.rounding, largest_move=mesh.rounding.largest_move * most)


def _together(roundings: list[Rounding]) -> Rounding:
    """Of several meshes at once."""
    return Rounding(
        max((one.largest_move for one in roundings), default=0.0),
        sum(one.degenerate for one in roundings),
    )


def _shifted(triangles: UInt32Array, count: int, offset: int) -> UInt32Array:
    if len(triangles) and int(triangles.max()) >= count:
        return np.where(triangles < count, triangles + np.uint32(offset), np.uint32(NO_MATERIAL))
    return triangles + np.uint32(offset)


def _with_all_attributes(blocks: list[Mesh], parts: list[Part]) -> list[Mesh]:
    wanted = {
        key
        for key in ("normals", "tangents", "uvs", "colors")
        if any(getattr(b, key) is not None for b in blocks)
    }
    if "tangents" in wanted:
        wanted.add("normals")
    sets = max(len(b.uv_sets) for b in blocks)
    if sets:
        wanted.add("uvs")
    influences = max(0 if b.joints is None else b.joints.shape[1] for b in blocks)
    own: list[list[UInt32Array]] = [[np.zeros((0, 3), np.uint32)] for _ in blocks]
    for number, triangles, _ in parts:
        own[number].append(triangles)
    return [
        _skinned(_filled(block, np.concatenate(triangles), wanted, sets), influences)
        for block, triangles in zip(blocks, own, strict=True)
    ]


def _skinned(block: Mesh, influences: int) -> Mesh:
    """With so many joints a vertex; those that are new move nothing."""
    n = len(block.positions)
    if influences == 0:
        return block
    joints, weights = np.zeros((n, influences), np.uint32), np.zeros((n, influences), np.float32)
    if block.joints is not None and block.weights is not None:
        joints[:, : block.joints.shape[1]] = block.joints
        weights[:, : block.weights.shape[1]] = block.weights
    return replace(block, joints=joints, weights=weights)


def _filled(block: Mesh, triangles: UInt32Array, wanted: set[str], sets: int) -> Mesh:
    """The block, whose triangles these are, with the attributes that are wanted."""
    n = len(block.positions)
    normals, tangents, uvs, colors = block.normals, block.tangents, block.uvs, block.colors
    if normals is None and "normals" in wanted:
        normals = area_weighted_normals(block.positions, triangles)
    if tangents is None and "tangents" in wanted:
        assert normals is not None
        tangents = any_tangents(normals)
        if uvs is not None:
            inside = triangles[(triangles < n).all(axis=1)]
            tangents = uv_tangents(block.positions, inside, normals, uvs)
    if uvs is None and "uvs" in wanted:
        uvs = np.zeros((n, 2), np.float32)
    if colors is None and "colors" in wanted:
        colors = np.ones((n, 4), np.float32)
    missing = [np.zeros((n, 2), np.float32) for _ in range(sets - len(block.uv_sets))]
    return replace(
        block,
        normals=normals,
        tangents=tangents,
        uvs=uvs,
        colors=colors,
        uv_sets=[*block.uv_sets, *missing],
    )
