"""The folder of a tiled surface: one file a tile, and `tiles.json` with what belongs together."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float, Int, UInt8
from numpy.typing import ArrayLike

from reconstruction._src.base.atomic_write import find_leftovers, write_atomically
from reconstruction._src.base.bounded_read import read_npz
from reconstruction._src.base.errors import ReconstructionError
from reconstruction._src.base.typed_json import JsonError, read_json, write_json
from reconstruction._src.tiles.point_stream import MOST_PLACE, Place
from reconstruction._src.tiles.seams import Surface

INDEX = "tiles.json"
FORMAT = 1
_OWN = re.compile(r"tile_-?\d+_-?\d+\.npz")


@dataclass(frozen=True)
class TiledSurface:
    """A surface in tiles, of which only those are read that are wanted."""

    folder: Path  # where it lies
    tile: float  # edge of a tile [m]
    offset: tuple[float, float, float]  # `[3]` what was subtracted from the coordinates of the scan [m]
    places: tuple[Place, ...]  # columns and rows of the tiles that have a surface

    @classmethod
    def load(cls, folder: str | Path) -> "TiledSurface":
        """Read the index of a folder that `reconstruct_tiles` wrote."""
        folder = Path(folder)
        try:
            index = read_json(folder / INDEX)
            if index["format"] > FORMAT:
                raise ValueError("written by a newer version")
            if index["complete"] is not True:
                raise ValueError("the reconstruction did not end; start it again")
            entries = [entry["place"] for entry in index["tiles"]]
            places = tuple((int(column), int(row)) for column, row in entries)
            if any(not -MOST_PLACE <= number < MOST_PLACE for place in places for number in place):
                raise ValueError(f"a place is beyond {MOST_PLACE} tiles")
            x, y, z = (float(value) for value in index["offset"])
            return cls(folder, float(index["tile"]), (x, y, z), places)
        except (JsonError, KeyError, OverflowError, TypeError, ValueError) as error:
            raise ReconstructionError(f"{folder / INDEX}: no index of tiles ({error})") from error

    @property
    def bounds(self) -> Float[np.ndarray, "2 2"]:
        """Lower and upper (x, y) of all tiles [m]."""
        places = np.array(self.places).reshape(-1, 2)
        return np.stack([places.min(axis=0), places.max(axis=0) + 1]) * self.tile

    def find_places(self, center: ArrayLike, radius: float) -> list[Place]:
        """Return the tiles that a circle in plan touches."""
        low = np.array(self.places).reshape(-1, 2) * self.tile
        middle = np.asarray(center, dtype=np.float64)[:2]
        nearest = np.clip(middle, low, low + self.tile)
        is_near = np.linalg.norm(nearest - middle, axis=1) <= radius
        return [place for place, chosen in zip(self.places, is_near, strict=True) if chosen]

    def mesh(self, center: ArrayLike | None = None, radius: float = np.inf) -> trimesh.Trimesh:
        """Return the tiles around a place as one mesh; all of them by default."""
        middle = self.bounds.mean(axis=0) if center is None else np.asarray(center, dtype=np.float64)[:2]
        places = self.find_places(middle, radius)
        if not places:
            there = " to ".join(str(corner.tolist()) for corner in self.bounds)
            raise ReconstructionError(
                f"no tile within {radius:g} m of {middle.tolist()}; there are {there} m"
            )
        parts = [read_surface(self.folder / name_tile(place)) for place in places]
        meshes = [trimesh.Trimesh(*part, vertex_colors=colors, process=False) for part, colors in parts]
        mesh: Any = trimesh.util.concatenate(meshes)
        mesh.merge_vertices()  # both sides of a seam have the same ones
        return mesh


def name_tile(place: Place) -> str:
    """Return the name of a tile's file."""
    return f"tile_{place[0]}_{place[1]}.npz"


def claim_folder(folder: Path) -> None:
    """Make a folder ready for tiles: what a former reconstruction left is removed, other files stay."""
    if folder.exists() and not folder.is_dir():
        raise ReconstructionError(f"{folder} is a file; choose another folder")
    index = folder / INDEX
    if index.exists():
        try:
            is_own = isinstance(read_json(index)["tiles"], list)
        except (JsonError, KeyError, TypeError):
            is_own = False
        if not is_own:
            raise ReconstructionError(f"{index} is damaged or of another program; choose another folder")
    elif folder.exists() and set(folder.iterdir()) - find_leftovers(folder).keys():
        raise ReconstructionError(f"{folder} is not empty and holds no tiles; choose another folder")
    folder.mkdir(parents=True, exist_ok=True)
    write_index(folder, {"complete": False, "tiles": []})
    for path in folder.iterdir():
        if _OWN.fullmatch(path.name) and path.is_file():
            path.unlink()


def write_index(folder: Path, content: dict[str, Any]) -> None:
    """Write `tiles.json`."""
    write_json(folder / INDEX, {"format": FORMAT, **content})


def write_surface(
    path: Path,
    vertices: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    colors: UInt8[np.ndarray, "V 3"] | None = None,
) -> None:
    """Write the surface of a tile, with the colors of its vertices where they are known."""
    arrays = {"vertices": vertices, "faces": faces.astype(np.int32)}
    if colors is not None:
        arrays["colors"] = colors
    with write_atomically(path) as temporary:
        np.savez_compressed(temporary, **arrays)  # pyright: ignore[reportArgumentType]


def read_surface(path: Path) -> tuple[Surface, UInt8[np.ndarray, "V 3"] | None]:
    """Read the surface of a tile, and the colors of its vertices where it has them."""
    try:
        arrays = read_npz(path)
        vertices, faces = arrays["vertices"].astype(np.float64), arrays["faces"].astype(np.int64)
        colors = arrays.get("colors")
        if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
            raise ValueError("not a mesh of triangles")
        if colors is not None and (colors.dtype != np.uint8 or colors.shape != vertices.shape):
            raise ValueError(f"colors are {colors.dtype} of {colors.shape}")
        is_whole = not len(faces) or 0 <= faces.min() <= faces.max() < len(vertices)
        if not np.isfinite(vertices).all() or not is_whole:
            raise ValueError("a face names a vertex that is not there")
    except (OSError, ValueError, KeyError) as error:
        raise ReconstructionError(f"{path}: no surface of a tile ({error}); reconstruct again") from error
    return Surface(vertices, faces), colors
