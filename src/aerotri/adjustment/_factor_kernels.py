"""Kernels of the factor: blocks in and out of dense fronts.

A front lists its own photographs, then the photographs of its rows, then the border; `top` holds own × own, `low` the
rows and the border × own, `rest` rows and border × the same. Only lower triangles are used. `scale` is (n, 6).
"""

from __future__ import annotations

from numba import njit

B = 6


@njit(cache=True)
def scatter_blocks(block, local_row, local_col, flipped, blocks, block_row, block_col, scale, top, low):
    """Scaled matrix blocks into a front, the photograph eliminated later giving the row.

    `flipped` says that the stored block has the earlier photograph as its row, so that it goes in transposed.
    """
    own = top.shape[0]
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
                    top[r0 + r, c0 + c] = value
                else:
                    low[r0 - own + r, c0 + c] = value


@njit(cache=True)
def scatter_border(own, border, scale, border_scale, offset, low):
    """Scaled border of the front's own photographs into the last rows of `low`, which begin at `offset`."""
    for k in range(len(own)):
        i = own[k]
        for c in range(B):
            for t in range(border.shape[2]):
                low[offset + t, B * k + c] = border[i, c, t] * scale[i, c] * border_scale[t]


@njit(cache=True)
def extend_add(update, place, n_own, n_border, top, low, rest):
    """A child's update matrix added to its parent's front; `place` are the parent's positions of the child's rows."""
    child_border = B * len(place)
    parent_border = low.shape[0] - n_border
    for bj in range(len(place)):
        pj = place[bj]
        for c in range(B):
            source = B * bj + c
            if pj < n_own:
                target = B * pj + c
                for bi in range(bj, len(place)):
                    pi = place[bi]
                    for r in range(B):
                        if pi < n_own:
                            top[B * pi + r, target] += update[B * bi + r, source]
                        else:
                            low[B * (pi - n_own) + r, target] += update[B * bi + r, source]
                for t in range(n_border):
                    low[parent_border + t, target] += update[child_border + t, source]
            else:
                target = B * (pj - n_own) + c
                for bi in range(bj, len(place)):
                    pi = B * (place[bi] - n_own)
                    for r in range(B):
                        rest[pi + r, target] += update[B * bi + r, source]
                for t in range(n_border):
                    rest[parent_border + t, target] += update[child_border + t, source]
    for c in range(n_border):
        for t in range(n_border):
            rest[parent_border + t, parent_border + c] += update[child_border + t, child_border + c]


@njit(cache=True)
def extract_symmetric(above, place, n_border, out):
    """The rows of a child out of its parent's full symmetric front."""
    child_border = B * len(place)
    parent_border = above.shape[0] - n_border
    for bj in range(len(place)):
        for c in range(B):
            source, target = B * place[bj] + c, B * bj + c
            for bi in range(len(place)):
                for r in range(B):
                    out[B * bi + r, target] = above[B * place[bi] + r, source]
            for t in range(n_border):
                value = above[parent_border + t, source]
                out[child_border + t, target] = value
                out[target, child_border + t] = value
    for c in range(n_border):
        for t in range(n_border):
            out[child_border + t, child_border + c] = above[parent_border + t, parent_border + c]


@njit(cache=True)
def gather_blocks(block, local_row, local_col, flipped, front, block_row, block_col, scale, blocks):
    """The inverse's blocks out of a front, scaled back; the reverse of `scatter_blocks`."""
    for k in range(len(block)):
        b = block[k]
        i, j = block_row[b], block_col[b]
        r0, c0 = B * local_row[k], B * local_col[k]
        for c in range(B):
            for r in range(B):
                if flipped[k]:
                    blocks[b, c, r] = front[r0 + r, c0 + c] * scale[i, c] * scale[j, r]
                else:
                    blocks[b, r, c] = front[r0 + r, c0 + c] * scale[i, r] * scale[j, c]


@njit(cache=True)
def gather_border(own, front, scale, border_scale, border):
    """The inverse's border of the front's own photographs, scaled back."""
    offset = front.shape[0] - border.shape[2]
    for k in range(len(own)):
        i = own[k]
        for c in range(B):
            for t in range(border.shape[2]):
                border[i, c, t] = front[offset + t, B * k + c] * scale[i, c] * border_scale[t]
