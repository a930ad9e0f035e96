"""What a user may say about photographs that are written, with what holds where nothing is said."""

from __future__ import annotations

from typing import Literal, get_args

Resampling = Literal["bicubic", "lanczos"]
RESAMPLINGS: tuple[Resampling, ...] = get_args(Resampling)
Compression = Literal["keep", "deflate", "lzw", "zstd", "none"]
COMPRESSIONS: tuple[Compression, ...] = get_args(Compression)
RESAMPLING, COMPRESSION = RESAMPLINGS[0], COMPRESSIONS[0]
"""Where nothing is stated: the first of each."""
