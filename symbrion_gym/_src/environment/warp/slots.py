"""One model for simulations in different arenas: its static geoms are slots that every arena fills with its own."""

from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from jaxtyping import Int

from symbrion_gym._src.environment.world import World
from symbrion_gym._src.errors import OptionError

_ALIKE = ("type", "contype", "conaffinity", "condim", "group", "priority")
"""Properties of a geom that are one for all simulations of Warp: those of a slot."""
_OWN = ("pos", "quat", "size", "aabb", "rbound", "friction", "rgba", "matid", "solmix", "solref", "solimp")
_OWN += ("margin", "gap")
"""Properties that each simulation has its own of, beside the shape (`geom_dataid`)."""
_SIZES = {"nq": "coordinates", "nu": "servos", "nbody": "bodies", "nsite": "sites", "nsensordata": "readings"}
_PLACES = ("geom_xpos", "geom_xmat")  # Of static geoms, which Warp computes once for all simulations
_FAR = -1e5  # Height at which a slot lies in arenas that leave it empty [m]
_CORNERS = np.vstack([np.zeros(3), np.eye(3)])  # Of the tetrahedron that is in a slot of the model


class SharedModel(NamedTuple):
    """A model for A arenas, and what makes it that of each of them."""

    model: mujoco.MjModel  # the robot, and slots
    # whose meshes and height fields `geom_dataid` names; None for those of `model`
    shapes: mujoco.MjModel | None
    fields: dict[str, Any]  # fields of the model -> `[A, ngeom, ...]`
    places: dict[str, Any]  # fields of the state that no step changes -> `[A, ngeom, ...]`
    geoms: list[Int[np.ndarray, " G"]]  # geom of this model that each geom of an arena's own model is


def check_alike(worlds: Sequence[World]) -> None:
    """Refuse worlds whose states differ in size."""
    first, last = worlds[0], worlds[-1]
    for size, what in _SIZES.items():
        if getattr(last.model, size) != getattr(first.model, size):
            raise OptionError(
                f"arenas {first.arena.name!r} and {last.arena.name!r} differ in the number of {what}, which backend "
                "'warp' cannot step together; leave out backend"
            )


def share_model(worlds: Sequence[World]) -> SharedModel:
    """Return a model in whose simulations the arena may be any of those of some worlds with one robot."""
    first = worlds[0]
    if len(worlds) == 1:
        return SharedModel(first.model, None, {}, {}, [np.arange(first.model.ngeom)])
    all_kinds = [_list_kinds(world.model) for world in worlds]
    counts: Counter[tuple[int, ...]] = Counter()
    for kinds in all_kinds:
        counts |= Counter(kinds)
    shapes, model = _make_shapes(worlds).compile(), _make_slots(first, counts).compile()
    shared = SharedModel(model, shapes, {}, {}, [])
    begins = dict(zip(counts, np.cumsum([0, *counts.values()]), strict=False))
    for number, (world, kinds) in enumerate(zip(worlds, all_kinds, strict=True)):
        used: Counter[tuple[int, ...]] = Counter()
        geoms = np.arange(world.model.ngeom) - world.model.ngeom + model.ngeom  # the robot is last in both
        for geom, kind in enumerate(kinds):
            geoms[geom] = begins[kind] + used[kind]
            used[kind] += 1
        shared.geoms.append(geoms)
        _fill(shared, world.model, geoms, _find_shapes(world.model, shapes, f"{number}/" if number else ""))
    return shared._replace(
        fields={name: np.array(each) for name, each in shared.fields.items()},
        places={name: np.array(each) for name, each in shared.places.items()},
    )


def _list_kinds(model: mujoco.MjModel) -> list[tuple[int, ...]]:
    """Return the properties of static geoms that only those in one slot share; they are the first of a model."""
    count = int(np.count_nonzero(model.geom_bodyid == 0))
    return list(zip(*(getattr(model, f"geom_{name}")[:count].tolist() for name in _ALIKE), strict=True))


def _make_shapes(worlds: Sequence[World]) -> mujoco.MjSpec:
    spec = worlds[0].make_spec()
    for number, world in enumerate(worlds[1:], 1):
        spec.attach(world.arena.spec(), prefix=f"{number}/", frame=spec.worldbody.add_frame())
    return spec


def _make_slots(world: World, counts: Counter[tuple[int, ...]]) -> mujoco.MjSpec:
    """Return the spec of a world with slots, in the order of `counts`, in place of static geoms."""
    spec = world.make_spec()
    for geom in list(spec.worldbody.geoms):
        spec.delete(geom)
    spec.add_mesh(name="slot", uservert=_CORNERS.ravel())
    spec.add_hfield(name="slot", nrow=2, ncol=2, size=[1.0, 1.0, 1.0, 1.0], userdata=[0.0, 0.0, 0.0, 1.0])
    for kind, count in counts.items():
        wanted: dict[str, Any] = dict(
            zip(_ALIKE, kind, strict=True), size=[1.0, 1.0, 1.0], pos=[0.0, 0.0, _FAR]
        )
        if kind[0] == mujoco.mjtGeom.mjGEOM_MESH:
            wanted["meshname"] = "slot"
        if kind[0] == mujoco.mjtGeom.mjGEOM_HFIELD:
            wanted["hfieldname"] = "slot"
        for _ in range(count):  # empty: rays do not see what is transparent
            spec.worldbody.add_geom(**wanted, rgba=[0.0, 0.0, 0.0, 0.0])
    return spec


def _find_shapes(model: mujoco.MjModel, shapes: mujoco.MjModel, prefix: str) -> Int[np.ndarray, " G"]:
    """Return which mesh or height field of all shapes each geom of an arena's model has; -1 for none."""
    found = np.full(model.ngeom, -1)
    for geom in np.flatnonzero(model.geom_dataid >= 0):
        is_field = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_HFIELD
        find, name = (shapes.hfield, model.hfield) if is_field else (shapes.mesh, model.mesh)
        own = "" if model.geom_bodyid[geom] else prefix  # the robot's are those of the first arena's
        found[geom] = find(own + name(model.geom_dataid[geom]).name).id
    return found


def _fill(
    shared: SharedModel, model: mujoco.MjModel, geoms: Int[np.ndarray, " G"], shapes: Int[np.ndarray, " G"]
) -> None:
    """Append the fields that put the static geoms of an arena's model into their slots."""
    data, own_data = mujoco.MjData(shared.model), mujoco.MjData(model)
    mujoco.mj_kinematics(shared.model, data)
    mujoco.mj_kinematics(model, own_data)
    for sources, names, into in (
        ((shared.model, model), [f"geom_{name}" for name in _OWN], shared.fields),
        ((data, own_data), _PLACES, shared.places),
    ):
        for name in names:
            values, own = (getattr(source, name) for source in sources)
            values = values.copy()
            values[geoms] = -1 if name == "geom_matid" else own
            into.setdefault(name, []).append(values)
    dataid = np.where(shared.model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD, 0, -1)
    dataid[geoms] = shapes
    shared.fields.setdefault("geom_dataid", []).append(dataid)
