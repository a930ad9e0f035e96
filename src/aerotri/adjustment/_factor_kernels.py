"""Kernels of the factor: blocks in and out of dense fronts.

A front lists its own photographs, then the photographs of its rows, then the border; `top` holds own × own, `low` the
rows and the border × own, `rest` rows and border × the same. Only lower triangles are used. Fronts come as flat arrays
in Fortran order (element (r, c) at r + c·rows), so that each kernel is compiled once. `scale` is (n, 6).
"""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel

B = 6
"""Unknowns of a photograph, the size of its blocks: three of the projection centre and three of the rotation."""


@kernel
def scatter_blocks(places, matrix, front):
    """Scaled matrix blocks into a front, the photograph eliminated later giving the row.

    `flipped` says that the stored block has the earlier photograph as its row, so that it goes in transposed.
    """
    block, local_row, local_col, flipped = places.block, places.local_row, places.local_col, places.flipped
    blocks, block_row, block_col, scale = matrix.blocks, matrix.row, matrix.col, matrix.scale
    own, rows, top, low = front.own, front.rows, front.top, front.low
    for k in range(len(block)):
        b = block[k]
        i, j = block_row[b], block_col[b]
        r0, c0 = B * local_row[k], B * local_col[k]
        for c in range(B):
            for r in range(B):
                if flipped[k]:
                    value = blocks[b, c, r] * scale[i, c] * scale[j, r]
                else:
                    value = blocks[b, r, c] * scale[i, r] * scale[j, c]
                if r0 < own:
                    top[r0 + r + (c0 + c) * own] = value
                else:
                    low[r0 - own + r + (c0 + c) * rows] = value


@kernel
def scatter_border(images, border, scale, border_scale, rows, low):
    """Scaled border of the front's own photographs into the last rows of `low`."""
    n_border = border.shape[1]
    for k in range(len(images)):
        i = images[k]
        for c in range(B):
            target = (B * k + c) * rows + rows - n_border
            for t in range(n_border):
                low[target + t] = border[i, t, c] * scale[i, c] * border_scale[t]


@kernel
def extend_add(update, place, n_own, n_border, front, rest):
    """A child's update matrix added to its parent's front.

    place : the parent's positions of the child's row photographs. n_own : photographs of the parent's own.
    """
    own, rows, top, low = front.own, front.rows, front.top, front.low
    child = B * len(place) + n_border
    for bj in range(len(place)):
        pj = place[bj]
        for c in range(B):
            source = (B * bj + c) * child
            if pj < n_own:
                in_top, in_low = (B * pj + c) * own, (B * pj + c) * rows
                for bi in range(bj, len(place)):
                    pi = place[bi]
                    if pi < n_own:
                        for r in range(B):
                            top[in_top + B * pi + r] += update[source + B * bi + r]
                    else:
                        for r in range(B):
                            low[in_low + B * (pi - n_own) + r] += update[source + B * bi + r]
                for t in range(n_border):
                    low[in_low + rows - n_border + t] += update[source + child - n_border + t]
            else:
                in_rest = (B * (pj - n_own) + c) * rows
                for bi in range(bj, len(place)):
                    pi = B * (place[bi] - n_own)
                    for r in range(B):
                        rest[in_rest + pi + r] += update[source + B * bi + r]
                for t in range(n_border):
                    rest[in_rest + rows - n_border + t] += update[source + child - n_border + t]
    for c in range(n_border):
        source = (child - n_border + c) * child + child - n_border
        target = (rows - n_border + c) * rows + rows - n_border
        for t in range(n_border):
            rest[target + t] += update[source + t]


@kernel
def extract_lower(top, low, rest, n_own, place, n_border, out):
    """Lower triangle of a child's rows out of its parent's inverse, kept in three parts as a front is."""
    own = B * n_own
    rows = len(low) // own if own else int(np.sqrt(len(rest)) + 0.5)
    size = B * len(place) + n_border
    for bj in range(len(place)):
        pj = place[bj]
        for c in range(B):
            target = (B * bj + c) * size
            if pj < n_own:
                in_top, in_low = (B * pj + c) * own, (B * pj + c) * rows
                for bi in range(bj, len(place)):
                    pi = place[bi]
                    if pi < n_own:
                        for r in range(B):
                            out[target + B * bi + r] = top[in_top + B * pi + r]
                    else:
                        for r in range(B):
                            out[target + B * bi + r] = low[in_low + B * (pi - n_own) + r]
                for t in range(n_border):
                    out[target + size - n_border + t] = low[in_low + rows - n_border + t]
            else:
                in_rest = (B * (pj - n_own) + c) * rows
                for bi in range(bj, len(place)):
                    pi = B * (place[bi] - n_own)
                    for r in range(B):
                        out[target + B * bi + r] = rest[in_rest + pi + r]
                for t in range(n_border):
                    out[target + size - n_border + t] = rest[in_rest + rows - n_border + t]
    for c in range(n_border):
        source = (rows - n_border + c) * rows + rows - n_border
        target = (size - n_border + c) * size + size - n_border
        for t in range(c, n_border):
            out[target + t] = rest[source + t]


@kernel
def gather_blocks(places, front, matrix):
    """The inverse's blocks out of a front, scaled back; the reverse of `scatter_blocks`."""
    block, local_row, local_col, flipped = places.block, places.local_row, places.local_col, places.flipped
    blocks, block_row, block_col, scale = matrix.blocks, matrix.row, matrix.col, matrix.scale
    own, rows, top, low = front.own, front.rows, front.top, front.low
    for k in range(len(block)):
        b = block[k]
        i, j = block_row[b], block_col[b]
        r0, c0 = B * local_row[k], B * local_col[k]
        for c in range(B):
            for r in range(B):
                if r0 < own:
                    # only the lower triangle holds numbers
                    row, column = max(r0 + r, c0 + c), min(r0 + r, c0 + c)
                    value = top[row + column * own]
                else:
                    value = low[r0 - own + r + (c0 + c) * rows]
                if flipped[k]:
                    blocks[b, c, r] = value * scale[i, c] * scale[j, r]
                else:
                    blocks[b, r, c] = value * scale[i, r] * scale[j, c]


@kernel
def gather_border(images, low, rows, scale, border_scale, border):
    """The inverse's border of the front's own photographs, scaled back."""
    n_border = border.shape[1]
    for k in range(len(images)):
        i = images[k]
        for c in range(B):
            source = (B * k + c) * rows + rows - n_border
            for t in range(n_border):
                border[i, t, c] = low[source + t] * scale[i, c] * border_scale[t]
