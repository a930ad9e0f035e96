"""Where places lie in a photograph, with its image errors: many places at once."""

from __future__ import annotations

from aerotri.compiled import kernel
from aerotri.functional_model._photo_kernels import project, tile_of
from aerotri.terrain._view_kernels import is_seen, photo_place


@kernel
def photo_places(view, k, places, out):
    """(n, 2) column and row px of places (n, 3) in photograph k; NaN behind the camera."""
    for p in range(len(places)):
        x, y, z = places[p, 0], places[p, 1], places[p, 2]
        ideal_x, ideal_y, _ = project(view.photos, 0, k, x, y, z)
        i, j = tile_of(view.source[k], ideal_x, ideal_y, view.errors.edges)
        out[p, 0], out[p, 1] = photo_place(view, k, i, j, x, y, z)


@kernel
def seen_places(view, k, places, out):
    """(n,) whether places (n, 3) lie in the usable part of photograph k."""
    for p in range(len(places)):
        out[p] = is_seen(view, k, places[p, 0], places[p, 1], places[p, 2])
