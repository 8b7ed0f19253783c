"""What was compiled is kept on the disk: the next start of the editor need not do it again."""

from __future__ import annotations

import warnings

import jax

from getup_jax.core.resources import cache_dir

_WORTH_S = 0.2  # programs that take longer to compile are kept


def keep_compiled() -> None:
    """Keep JAX's programs in the cache folder, unless JAX_COMPILATION_CACHE_DIR names another one.

    Programs that call back into Python, as the steps of the physics do, are never kept by JAX.
    """
    if jax.config.jax_compilation_cache_dir is not None:
        return
    try:
        folder = cache_dir() / "compiled"
    except OSError as error:
        warnings.warn(f"every start compiles anew: {error}", stacklevel=2)
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", _WORTH_S)
