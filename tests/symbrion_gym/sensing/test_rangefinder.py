"""Range finders in a running simulation."""

import mujoco
import numpy as np
import pytest
import trimesh

from symbrion_gym._src.errors import ArenaError
from symbrion_gym._src.sensing.rangefinder import RangeFinder
from symbrion_gym._src.sensing.survey_robot import LaserScanner

WORLD = """
<mujoco>
  <worldbody>
    <geom name="surface" type="box" size=".1 3 1" pos="2.1 0 1" group="2" contype="0" conaffinity="0"/>
    <geom name="piece" type="box" size=".1 3 1" pos="1.6 0 1" group="3"/>
    <body name="robot" pos="0 0 0.5">
      <freejoint/>
      <geom name="chassis" type="box" size=".1 .1 .1" group="2"/>
      <site name="laser" pos="0 0 0"/>
      <body name="arm" pos=".2 0 0">
        <joint type="hinge" axis="0 1 0"/>
        <geom name="arm" type="box" size=".05 .05 .05" group="2"/>
      </body>
    </body>
    <body name="other" pos="0 1 0.5"><freejoint/><geom name="other" type="sphere" size=".2" group="2"/></body>
  </worldbody>
</mujoco>
"""
FAN = LaserScanner(num_beams=3, field_of_view=np.pi)


@pytest.fixture
def scene():
    model = mujoco.MjModel.from_xml_string(WORLD)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def test_ranges_to_the_surface_and_to_others(scene):
    finder = RangeFinder(scene[0], "laser", FAN, exclude=["robot", "arm"])
    np.testing.assert_allclose(finder.read(scene[1]), [np.nan, 2.0, 0.8], atol=1e-6)


def test_contact_pieces_are_never_seen(scene):
    with pytest.raises(ArenaError, match="contact"):
        RangeFinder(scene[0], "laser", FAN, groups=range(6))


def test_beyond_the_range_there_is_nothing(scene):
    scanner = LaserScanner(num_beams=3, max_range=1.9)
    assert np.isnan(RangeFinder(scene[0], "laser", scanner, exclude=["robot", "arm"]).read(scene[1])[1])


def test_noise_is_the_scanners_and_seeded(scene):
    model, data = scene
    finder = RangeFinder(
        model, "laser", LaserScanner(num_beams=181, field_of_view=1.0), exclude=["robot", "arm"]
    )
    exact = finder.read(data)
    readings = np.stack([finder.read(data, np.random.default_rng(i)) for i in range(30)])
    error = (readings - exact)[:, np.abs(exact - 2.0) < 0.3]
    assert np.nanstd(error) == pytest.approx(0.006, rel=0.1)
    np.testing.assert_array_equal(readings[3], finder.read(data, np.random.default_rng(3)))


def test_a_mesh_is_hit_where_embree_hits_it():
    rng = np.random.default_rng(0)
    surface = trimesh.creation.icosphere(subdivisions=4)
    surface.vertices *= 1 + 0.2 * rng.random((len(surface.vertices), 1))
    spec = mujoco.MjSpec()
    mesh = spec.add_mesh(name="surface")
    mesh.uservert, mesh.userface = surface.vertices.ravel(), surface.faces.ravel()
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH, meshname="surface", group=2, contype=0, conaffinity=0
    )
    spec.worldbody.add_site(name="eye", pos=[3.0, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    directions = np.c_[-np.ones(10_000), rng.uniform(-0.25, 0.25, (10_000, 2))]
    ranges = RangeFinder(model, "eye", directions=directions).read(data)
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    origins = np.tile([3.0, 0, 0], (len(unit), 1))
    places, rays, _ = surface.ray.intersects_location(origins, unit, multiple_hits=False)
    exact = np.full(len(unit), np.nan)
    exact[rays] = np.linalg.norm(places - origins[rays], axis=1)
    both = np.isfinite(exact) & np.isfinite(ranges)
    assert both.sum() > 9_900
    assert np.abs(exact - ranges)[both].max() < 1e-4


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ({"site": "eye"}, "laser"),
        ({"site": 9}, "no site 9"),
        ({"site": "laser", "exclude": ["leg"]}, "robot"),
        ({"site": "laser", "directions": [[0, 0, 0]]}, "length"),
        ({"site": "laser", "directions": [1, 0, 0]}, r"\[R, 3\]"),
    ],
)
def test_what_is_not_there_is_named(scene, arguments, reason):
    with pytest.raises(ArenaError, match=reason):
        RangeFinder(scene[0], **arguments)
