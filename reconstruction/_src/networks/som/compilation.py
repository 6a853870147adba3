"""Keep compiled programs between processes, so that a new process starts at once."""

import logging

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
