"""The loaders of an export run as they lie in its folder; where a simulator is absent, against its documented names."""

import dataclasses
import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import mujoco
import pytest
from exported import make_mixed_arena

from symbrion_gym._src.arenas.export.export import read_template

BALL = """<mujoco><worldbody><body name="ball" pos="4.3 1.5 1"><freejoint/><geom size="0.05"/></body>
</worldbody></mujoco>"""


def run_loader(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def is_installed(name: str) -> bool:
    return importlib.util.find_spec(name) is not None


def put_stand_in(monkeypatch: pytest.MonkeyPatch, place: str, name: str, **fields: Any) -> None:
    """Put a dataclass with the documented fields where a simulator that is not installed has its own."""
    parts = place.split(".")
    for i in range(len(parts)):
        monkeypatch.setitem(sys.modules, ".".join(parts[: i + 1]), ModuleType(".".join(parts[: i + 1])))
    described = [(key, Any, dataclasses.field(default=value)) for key, value in fields.items()]
    setattr(sys.modules[place], name, dataclasses.make_dataclass(name, described, kw_only=True))


def test_the_loader_for_playground_gives_a_model_that_moves(tmp_path: Path) -> None:
    make_mixed_arena().export(tmp_path, "mjcf")
    model = run_loader(tmp_path / "load_playground.py").load_model(BALL)
    _assert_ball_lands(model)


def test_the_loader_for_mjlab_adds_the_ground_to_a_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not is_installed("mjlab"):
        fields = {"num_envs": 1, "env_spacing": 2.0, "terrain": None, "entities": None, "spec_fn": None}
        put_stand_in(monkeypatch, "mjlab.scene", "SceneCfg", **fields)
    make_mixed_arena().export(tmp_path, "mjcf")
    scene = run_loader(tmp_path / "load_mjlab.py").make_scene(num_envs=3)
    assert (scene.num_envs, scene.terrain, scene.env_spacing) == (3, None, 0.0)
    spec = mujoco.MjSpec.from_string(BALL)
    scene.spec_fn(spec)
    model = spec.compile()
    assert model.body("terrain").parentid == 0
    _assert_ball_lands(model)


def test_the_loader_for_isaac_lab_names_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if is_installed("isaaclab"):
        pytest.skip("Isaac Lab starts a simulator on import; this test needs none")
    fields = {"prim_path": None, "terrain_type": "generator", "usd_path": None, "env_spacing": None}
    put_stand_in(monkeypatch, "isaaclab.terrains", "TerrainImporterCfg", **fields)
    (tmp_path / "load_isaaclab.py").write_text(read_template("load_isaaclab.py.txt"))
    terrain = run_loader(tmp_path / "load_isaaclab.py").make_terrain()
    assert terrain.terrain_type == "usd"
    assert terrain.usd_path == str(tmp_path / "arena.usda")


def _assert_ball_lands(model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    touched = False
    for _ in range(500):
        mujoco.mj_step(model, data)
        touched |= data.ncon > 0
    assert touched
    assert data.qpos[2] > -1.0 or data.qpos[0] > 5.0
