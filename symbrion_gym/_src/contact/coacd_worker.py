"""coacd in a process of its own: it can crash, or never end, and would take its caller along.

Run as `python -P coacd_worker.py INPUT.npz OUTPUT.npz`, without the rest of the package; see `coacd.py`.
"""

import json
import sys
from typing import Any

import numpy as np


def main(source: str, target: str) -> None:
    """Decompose `vertices` and `faces` of one file into pieces in another."""
    import coacd

    with np.load(source, allow_pickle=False) as given:
        mesh = coacd.Mesh(given["vertices"], given["faces"])
        options = json.loads(str(given["options"]))
    coacd.set_log_level("error")
    pieces = coacd.run_coacd(mesh, **options)
    corners: dict[str, Any] = {
        f"vertices_{i}": np.asarray(vertices, np.float64) for i, (vertices, _) in enumerate(pieces)
    }
    np.savez(target, count=len(pieces), **corners)


if __name__ == "__main__":
    main(*sys.argv[1:])
