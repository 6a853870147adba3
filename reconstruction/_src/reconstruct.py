"""From points to a surface by one call."""

from dataclasses import replace

from numpy.typing import ArrayLike

from reconstruction._src.base.progress import Progress, silent
from reconstruction._src.base.range_checks import format_share
from reconstruction._src.input_cloud import make_cloud
from reconstruction._src.methods import find_method, make_config
from reconstruction._src.networks.som.compilation import keep_compiled_programs
from reconstruction._src.reconstruction import Reconstruction
from reconstruction._src.scans.cloud import Cloud
from reconstruction._src.scans.point_rows import MIN_UNITS, check_number, check_seed

DEFAULT_UNITS = 2200  # Of the paper's mode: that of its experiments


def reconstruct(
    points: ArrayLike | Cloud,
    method: str = "gsrm",
    units: int | None = None,
    seed: int = 0,
    mode: str = "batch",
    progress: Progress = silent,
    *,
    viewpoints: ArrayLike | None = None,
    seen_from: ArrayLike | None = None,
    colors: ArrayLike | None = None,
    readings: ArrayLike | Cloud | None = None,
    **options: object,
) -> Reconstruction:
    """Grow a self-organizing network over a point cloud and return its surface.

    A cloud far from the origin is recentered: the mesh and the points of the result are positions minus its
    `offset`, which are whole meters.

    Args:
        points: `[N, 3]` positions [m], any real number type, or a `Cloud` with its viewpoints and colors; 20 for each
            unit are a good number.
        method: "gsrm" (growing self-reconstruction map: any topology) or "gg" (growing grid: one sheet).
        units: number of neurons, the resolution; None: enough for the scan, 500 to 8,000 (`choose_units`), in paper
            mode 2200.
        seed: equal seeds give equal meshes, byte for byte; on a GPU almost equal ones.
        mode: "batch" (fast) or "paper" (the literal sequential rules, slow).
        progress: called with each step and the fraction done.
        viewpoints: `[3]` or `[K, 3]` positions of the sensor, in the frame of the points [m]: the surface looks to
            where it was seen from. Without them sheets look up (along z), closed surfaces outwards.
        seen_from: `[N]` index of the viewpoint that each point was seen from; without it, of several viewpoints the
            nearest one from which no other point hides it is taken.
        colors: `[N, 3]` red, green and blue of the points, 0 to 255.
        readings: all points of the scan, in the same frame, where `points` are those that pre-processing kept:
            `quality` is measured on these.
        options: further fields of `GSRMConfig` or `GrowingGridConfig`, such as `triangles=13860` for "gg".

    Raises:
        ReconstructionError: the points hold no surface, or an argument is out of its range.
    """
    cloud = make_cloud(points, viewpoints=viewpoints, seen_from=seen_from, colors=colors)
    network, config_type = find_method(method)
    selected = options if mode == "batch" else {"mode": mode, **options}
    is_chosen = units is None and mode == "batch" and "triangles" not in options
    config = make_config(config_type, {"units": DEFAULT_UNITS if units is None else units, **selected})
    check_number(cloud.points, MIN_UNITS if is_chosen else getattr(config, "wanted_units", config.units))
    if is_chosen:
        from reconstruction._src.resolution import choose_units

        config = replace(config, units=choose_units(cloud.points))
    seed = check_seed(seed)
    everything = None if readings is None else make_cloud(readings).in_frame_of(cloud)
    keep_compiled_programs()
    state = network.train(cloud.points, config, seed, progress)
    notes = {"units": f"{config.units}, chosen for the density of the points"} if is_chosen else {}
    result = Reconstruction(method, config, state, cloud, readings=everything, notes=notes)
    if result.dropped is not None:
        result.notes["dropped"] = f"pre-processing dropped {format_share(result.dropped)} of the readings"
    return result
