"""Keep compiled programs between processes, so that a new process starts at once."""

import logging

import numpy as np
from jaxtyping import Shaped

from reconstruction._src.base.cache import find_cache_folder

logger = logging.getLogger(__name__)


def keep_compiled_programs() -> None:
    """Make JAX keep its compiled programs in the user's cache folder, unless the user has selected another place."""
    import jax

    if getattr(jax.config, "jax_compilation_cache_dir", None) is not None:
        return
    try:
        folder = find_cache_folder("jax")
    except OSError as error:
        logger.warning("compiled programs are not kept, no folder can be written: %s", error)
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


_FEW = 2**15  # Up to this length there are two sizes an octave, beyond, where padding costs time, four


def padded_length(length: int, minimum: int = 512) -> int:
    """Return the smallest permitted length that holds `length`: few lengths, so that few programs are compiled."""
    length = max(int(length), minimum)
    step = max(1, 2 ** ((length - 1).bit_length() - 1) // (2 if length <= _FEW else 4))
    return -(-length // step) * step


def pad_rows(
    array: Shaped[np.ndarray, "N ..."], length: int, value: float = 0
) -> Shaped[np.ndarray, "length ..."]:
    """Return `array` with rows of `value` added until it has `length` rows."""
    if len(array) == length:
        return array
    padding = np.full((length - len(array), *array.shape[1:]), value, dtype=array.dtype)
    return np.concatenate([array, padding])
