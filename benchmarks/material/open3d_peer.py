"""Open3D in a Python of its own, which need not have this project: Poisson surfaces, and a second judge.

`PYTHON open3d_peer.py poisson IN.npz OUT.npz` and `PYTHON open3d_peer.py check IN.npz OUT.npz`.
"""

import sys
import time

import numpy as np
import open3d


def make_poisson(points, origins, num_triangles, depth=9, **_):
    """Reconstruct by Poisson at depth 9, cut what no reading supports, and decimate to a number of triangles."""
    begin = time.process_time()
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(20))
    if len(origins):
        normals = np.asarray(cloud.normals).copy()
        normals[np.einsum("ij,ij->i", normals, origins - points) < 0] *= -1
        cloud.normals = open3d.utility.Vector3dVector(normals)
    else:
        cloud.orient_normals_consistent_tangent_plane(15)
    mesh, density = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=int(depth))
    mesh.remove_vertices_by_mask(np.asarray(density) < np.quantile(np.asarray(density), 0.02))
    mesh = mesh.crop(cloud.get_axis_aligned_bounding_box())
    mesh = mesh.simplify_quadric_decimation(int(num_triangles))
    return {
        "vertices": np.asarray(mesh.vertices),
        "faces": np.asarray(mesh.triangles),
        "cpu_s": time.process_time() - begin,
    }


def check(points, vertices, faces, solid_vertices, solid_faces, origins, ends, **_):
    """Measure distances of all points from a surface, and the share of beams that end within 5 cm on contact."""
    distances = _make_scene(vertices, faces).compute_distance(points.astype(np.float32)).numpy()
    lengths = np.linalg.norm(ends - origins, axis=1)
    rays = np.hstack([origins, (ends - origins) / np.maximum(lengths, 1e-9)[:, None]]).astype(np.float32)
    found = {"points_mean": float(distances.mean()), "points_p95": float(np.percentile(distances, 95))}
    if len(rays):
        ranges = _make_scene(solid_vertices, solid_faces).cast_rays(rays)["t_hit"].numpy()
        found["beams"] = float(np.mean(np.abs(ranges - lengths) <= 0.05))
    return found


def _make_scene(vertices, faces):
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(vertices.astype(np.float32), faces.astype(np.uint32))
    return scene


def main():
    """Run one of the two jobs."""
    job, source, target = sys.argv[1:4]
    with np.load(source) as arrays:
        held = {name: arrays[name] for name in arrays.files}
    np.savez(target, **{"poisson": make_poisson, "check": check}[job](**held))


if __name__ == "__main__":
    main()
