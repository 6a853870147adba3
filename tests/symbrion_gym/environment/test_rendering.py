"""Images show the robot, in every mode."""

from dataclasses import replace

import gymnasium as gym
import imageio.v2 as imageio
import mujoco
import numpy as np
import pytest

import symbrion_gym as sg
from symbrion_gym._src.environment.organism_env import OrganismEnv
from symbrion_gym._src.environment.organism_vector_env import OrganismVectorEnv


@pytest.fixture(scope="module", autouse=True)
def _graphics():
    try:
        mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 32, 32).close()
    except Exception as error:
        pytest.skip(f"no graphics here: {error}")


def test_rgb_shows_a_dark_robot_before_bright_ground():
    env = OrganismEnv(modules=4, render_mode="rgb_array", width=320, height=200)
    env.reset(seed=0)
    picture = env.render()
    assert picture.shape == (200, 320, 3)
    assert picture.dtype == np.uint8
    middle = picture[70:130, 80:240].mean(axis=2)
    assert 0.02 < (middle < 60).mean() < 0.7
    assert picture.mean() > 90
    env.close()


def test_depth_and_both():
    env = OrganismEnv(modules=3, render_mode="rgbd_tuple", width=160, height=100)
    env.reset(seed=0)
    picture, depth = env.render()
    assert picture.shape == (100, 160, 3)
    assert depth.shape == (100, 160)
    assert 0.5 < depth[50, 80] < 3.0
    env.render_mode = "depth_array"
    np.testing.assert_array_equal(env.render(), depth)
    env.close()


def test_the_camera_follows_and_images_do_not_change_the_physics():
    options = {"modules": 3, "track_speed": 0.3}
    seen, blind = OrganismEnv(**options, render_mode="rgb_array", width=64, height=48), OrganismEnv(**options)
    for env in (seen, blind):
        env.reset(seed=0)
    seen.render()
    before = seen._renderer.camera.lookat.copy()
    for tick in range(100):
        one, other = seen.step(np.zeros(2)), blind.step(np.zeros(2))
        np.testing.assert_array_equal(one[0], other[0])
        if tick % 10 == 9:
            seen.render()
    assert seen._renderer.camera.lookat[0] > before[0] + 0.2
    seen.close()


def test_poles_stand_where_a_body_is_to_go_the_last_in_another_color():
    counts, depths = [], []
    for places in ((), ((-2.0, 0.0),)):
        way = {"start": (-2.3, 0.0), "places": places, "goal": (-1.9, 0.0)}
        env = OrganismEnv(modules=1, task="reach", **way, render_mode="rgb_array", width=320, height=200)
        env.reset(seed=0)
        red, green, blue = np.moveaxis(env.render().astype(int), 2, 0)
        env.render_mode = "depth_array"
        depths.append(env.render())
        env.close()
        is_bright = red > np.maximum(100, 1.8 * blue)
        counts.append([(is_bright & (green < red / 2)).sum(), (is_bright & (green > red / 2)).sum()])
    (last, none), (same, corner) = counts
    assert min(last, same, corner) > 100
    assert none < corner / 4
    np.testing.assert_array_equal(*depths)


def test_vector_environments_draw_each_simulation():
    envs = OrganismVectorEnv(2, modules=2, render_mode="rgb_array", width=64, height=48)
    envs.reset(seed=0, options={"yaw": np.array([0.0, 1.0])})
    one, other = envs.render()
    assert one.shape == (48, 64, 3)
    assert np.abs(one.astype(int) - other).max() > 30
    envs.close()


@pytest.mark.slow
def test_gymnasium_records_a_video(tmp_path):
    pytest.importorskip("moviepy", reason="the extra video is not installed")
    env = gym.make("symbrion_gym/SnakePit-v1", arena="truth", modules=3, render_mode="rgb_array")
    env = gym.wrappers.RecordVideo(env, str(tmp_path / "films"), episode_trigger=lambda episode: True)
    env.reset(seed=0)
    for _ in range(10):
        env.step(env.action_space.sample())
    env.close()
    (film,) = (tmp_path / "films").glob("*.mp4")
    with imageio.get_reader(film) as reader:
        assert reader.get_meta_data()["codec"] == "h264"
        assert reader.get_data(9).std() > 10.0


def test_without_a_mode_nothing_is_drawn():
    env = OrganismEnv(modules=2)
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode"):
        assert env.render() is None


def test_a_window_without_a_display_is_left_out(monkeypatch, caplog):
    monkeypatch.setattr("symbrion_gym._src.environment.rendering.has_display", lambda: False)
    env = OrganismEnv(modules=2, render_mode="human")
    env.reset(seed=0)
    env.step(np.zeros(1))
    assert env.render() is None
    assert caplog.text.count("no display") == 1
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("quality", "is_drawn"), [({"p95": 0.01}, False), ({"p95": 0.05}, True), ({"uncovered": 0.02}, True)]
)
def test_contact_is_drawn_where_it_differs_visibly_from_the_surface(quality, is_drawn):
    truth, pictures = sg.load_arena("truth"), []
    for arena in (truth, replace(truth, quality=replace(truth.quality, **quality))):
        env = OrganismEnv(arena=arena, modules=2, render_mode="rgb_array", width=64, height=48)
        env.reset(seed=0)
        pictures.append(env.render().astype(int))
        env.close()
    assert (np.abs(pictures[0] - pictures[1]).max() > 20) == is_drawn
