"""coacd in a process of its own: it can crash, or never end, and would take its caller along.

Run as `python -P coacd_worker.py INPUT.npz OUTPUT.npz`, without the rest of the package; see
`decomposition.py`.
"""

from __future__ import annotations

import json
import sys

import numpy as np


def main(source: str, target: str) -> None:
    """Decompose `vertices` and `faces` of one file into pieces in another."""
    import coacd

    with np.load(source, allow_pickle=False) as given:
        mesh = coacd.Mesh(given["vertices"], given["faces"])
        options = json.loads(str(given["options"]))
    coacd.set_log_level("error")
    pieces = coacd.run_coacd(mesh, **options)
    arrays = {}
    for i, (vertices, faces) in enumerate(pieces):
        arrays[f"vertices_{i}"] = np.asarray(vertices, dtype=np.float64)
        arrays[f"faces_{i}"] = np.asarray(faces, dtype=np.int64)
    np.savez(target, count=len(pieces), **arrays)


if __name__ == "__main__":
    main(*sys.argv[1:])
