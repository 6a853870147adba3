"""A tracked rover of one's own drives a route on a scanned arena; it is a box with `sg.add_tracks`."""

import mujoco
import numpy as np

import symbrion_gym as sg


def drive(name="gsrm", duration=120.0, watch=lambda model, data: None) -> tuple[np.ndarray, np.ndarray]:
    """Return where the rover got to, and its goal, (x, y) [m]."""
    arena = sg.load_arena(name)
    body = sg.Footprint(length=0.4, width=0.36, height=0.2, max_slope=0.3, max_step=0.03, radius=0.2)
    route = arena.find_route(body, start=(-2.5, -0.6), goal=(-0.72, 0.45))  # from the floor up the ramp
    spec = arena.spec()
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    rover = spec.worldbody.add_body(name="rover", pos=np.add(route.start, (0, 0, 0.1)))
    rover.add_freejoint()
    rover.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.17, 0.1, 0.03), pos=(0, 0, 0.02), mass=3)
    tracks = sg.add_tracks(spec, "rover", length=0.4, gauge=0.3, width=0.06, height=0.1)
    model = spec.compile()
    data, path = mujoco.MjData(model), route.path[:, :2]
    while data.time < duration and np.linalg.norm(path[-1] - data.qpos[:2]) > 0.1:
        place, forward = data.qpos[:2], data.body("rover").xmat[[0, 3]]
        ahead = (
            np.argmin(np.linalg.norm(path - place, axis=1)) + 2
        )  # points of the path are about 0.2 m apart
        x, y = path[min(ahead, len(path) - 1)] - place
        turn = 0.3 * np.arctan2(forward[0] * y - forward[1] * x, forward @ (x, y))
        speed = max(0.0, 0.2 - abs(turn))
        tracks.drive(model, data, speed - turn, speed + turn)
        mujoco.mj_step(model, data, 10)
        watch(model, data)
    return data.qpos[:2].copy(), path[-1]


if __name__ == "__main__":
    place, goal = drive()
    print(f"at ({place[0]:.2f}, {place[1]:.2f}) m, {np.linalg.norm(goal - place):.2f} m from the goal")
