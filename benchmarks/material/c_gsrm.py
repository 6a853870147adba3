"""Run the authors' own GSRM program.

The program is danfis/gnn (7de66ee) with danfis/boruvka (c82148a), built with gcc outside this repository;
give the path of its binary `gnn-gsrm`.
"""

import re
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import trimesh

_CLOCK = re.compile(r"\[(\d+):(\d+\.\d+)\] (?:n:|-\d+-)")


def run_c_gsrm(binary: Path, points: np.ndarray, units: int) -> tuple[float, trimesh.Trimesh]:
    """Reconstruct with the C program.

    Args:
        binary: path of `gnn-gsrm`.
        points: `[N, 3]`.
        units: number of neurons.

    Returns:
        Seconds by its own clock, from the first unit to the last face (without reading and writing), and its mesh.
    """
    with tempfile.TemporaryDirectory() as folder:
        cloud, surface = Path(folder) / "cloud.xyz", Path(folder) / "surface.svt"
        np.savetxt(cloud, points, fmt="%.9g")
        command = [str(binary), "-v", "-v", "-v", "--max-nodes", str(units), "-o", str(surface), str(cloud)]
        output = subprocess.run(command, capture_output=True, text=True, check=True).stderr
        clocks = _CLOCK.findall(output.replace("\r", "\n"))
        return 60 * float(clocks[-1][0]) + float(clocks[-1][1]), read_svt(surface)


def read_svt(path: Path) -> trimesh.Trimesh:
    """Read the vertices and triangles of an SVT file."""
    rows: dict[str, list[list[float]]] = {"Points:": [], "Faces:": []}
    wanted: list[list[float]] | None = None
    for line in path.read_text().splitlines():
        if line.startswith("--") or line[:1].isalpha():
            wanted = rows.get(line)
        elif wanted is not None:
            wanted.append([float(word) for word in line.split()])
    faces = np.array(rows["Faces:"], dtype=np.int64)[:, :3]
    return trimesh.Trimesh(np.array(rows["Points:"]), faces, process=False)
