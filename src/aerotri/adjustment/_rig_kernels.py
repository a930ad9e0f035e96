"""Kernels of rigid rigs: the normal matrix of photographs brought to stations and mountings, the inverse brought back.

Of photograph i with the orientation x_i at station a on mounting k: dx_i = J_i·dx_a + M_i·dm_k. `by_station` and
`by_mounting` (n, 6, 6) are J and M, `columns` (n, 6) the shared parameters m_k, −1 where an element is held or the
photograph leads its station: there J is the identity and M nothing. `place` (nb,) is the reduced block of every block,
`of` (n,) the station of every photograph.
"""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel, leaf_kernel

E = 6


@leaf_kernel
def product(a, b, out):
    """out = a·b, all (6, 6)."""
    for r in range(E):
        for c in range(E):
            value = 0.0
            for k in range(E):
                value += a[r, k] * b[k, c]
            out[r, c] = value


@leaf_kernel
def transposed_product(a, b, out):
    """out = aᵀ·b, all (6, 6)."""
    for r in range(E):
        for c in range(E):
            value = 0.0
            for k in range(E):
                value += a[k, r] * b[k, c]
            out[r, c] = value


@leaf_kernel
def add_product_transposed(a, b, out):
    """out += a·bᵀ, all (6, 6)."""
    for r in range(E):
        for c in range(E):
            value = 0.0
            for k in range(E):
                value += a[r, k] * b[c, k]
            out[r, c] += value


@kernel
def reduce_blocks(pattern, chain, blocks, sums):
    """The blocks of photographs (nb, 6, 6) added to blocks, border and corner of the reduced matrix, `sums`."""
    row, col, place, of = pattern.row, pattern.col, pattern.place, pattern.of
    by_station, by_mounting, columns = chain.by_station, chain.by_mounting, chain.columns
    out, border, corner = sums.blocks, sums.border, sums.corner
    of_station, of_mounting, both = np.empty((E, E)), np.empty((E, E)), np.empty((E, E))
    for b in range(len(blocks)):
        i, j = row[b], col[b]
        a, c, target = of[i], of[j], out[place[b]]
        transposed_product(by_station[i], blocks[b], of_station)
        transposed_product(by_mounting[i], blocks[b], of_mounting)
        product(of_station, by_station[j], both)
        for r in range(E):
            for t in range(E):
                if i == j or a < c:
                    target[r, t] += both[r, t]
                elif a > c:
                    target[t, r] += both[r, t]
                else:
                    target[r, t] += both[r, t]
                    target[t, r] += both[r, t]
        product(of_station, by_mounting[j], both)
        for t in range(E):
            if columns[j, t] >= 0:
                for r in range(E):
                    border[a, columns[j, t], r] += both[r, t]
        if i != j:
            product(of_mounting, by_station[j], both)
            for t in range(E):
                if columns[i, t] >= 0:
                    for r in range(E):
                        border[c, columns[i, t], r] += both[t, r]
        product(of_mounting, by_mounting[j], both)
        for r in range(E):
            for t in range(E):
                if columns[i, r] >= 0 and columns[j, t] >= 0:
                    corner[columns[i, r], columns[j, t]] += both[r, t]
                    if i != j:
                        corner[columns[j, t], columns[i, r]] += both[r, t]


@kernel
def reduce_border(pattern, chain, border, sums):
    """The border of photographs (n, s, 6) added to border and corner of the reduced matrix, `sums`."""
    of, by_station, by_mounting, columns = pattern.of, chain.by_station, chain.by_mounting, chain.columns
    out, corner = sums.border, sums.corner
    for i in range(len(of)):
        for s in range(border.shape[1]):
            for t in range(E):
                station, mounting = 0.0, 0.0
                for r in range(E):
                    station += by_station[i, r, t] * border[i, s, r]
                    mounting += by_mounting[i, r, t] * border[i, s, r]
                out[of[i], s, t] += station
                if columns[i, t] >= 0:
                    corner[columns[i, t], s] += mounting
                    corner[s, columns[i, t]] += mounting


@kernel
def expand_blocks(pattern, chain, inverse, out):
    """The inverse over photographs on their own pattern, out (nb, 6, 6), from that over stations and mountings."""
    row, col, place, of = pattern.row, pattern.col, pattern.place, pattern.of
    by_station, by_mounting, columns = chain.by_station, chain.by_mounting, chain.columns
    blocks, border, corner = inverse.blocks, inverse.border, inverse.corner
    q, mixed, at_station, at_mounting = np.empty((E, E)), np.empty((E, E)), np.empty((E, E)), np.empty((E, E))
    for b in range(len(row)):
        i, j = row[b], col[b]
        a, c, own = of[i], of[j], blocks[place[b]]
        for r in range(E):
            for t in range(E):
                q[r, t] = own[t, r] if a > c else own[r, t]
                mixed[r, t] = border[a, columns[j, t], r] if columns[j, t] >= 0 else 0.0
                at_station[r, t], at_mounting[r, t] = 0.0, 0.0
        add_product_transposed(q, by_station[j], at_station)
        add_product_transposed(mixed, by_mounting[j], at_station)
        for r in range(E):
            for t in range(E):
                mixed[r, t] = border[c, columns[i, r], t] if columns[i, r] >= 0 else 0.0
                q[r, t] = 0.0
                if columns[i, r] >= 0 and columns[j, t] >= 0:
                    q[r, t] = corner[columns[i, r], columns[j, t]]
        add_product_transposed(mixed, by_station[j], at_mounting)
        add_product_transposed(q, by_mounting[j], at_mounting)
        product(by_station[i], at_station, q)
        product(by_mounting[i], at_mounting, mixed)
        for r in range(E):
            for t in range(E):
                out[b, r, t] = q[r, t] + mixed[r, t]
