"""Kernel that lists which photographs share points."""

from __future__ import annotations

from aerotri.compiled import kernel


@kernel
def enumerate_pairs(start, image, n, codes):
    """image·n + other image for every pair of rays of every point, in the order the assembly meets them."""
    k = 0
    for p in range(len(start) - 1):
        for q in range(start[p], start[p + 1]):
            for other in range(q + 1, start[p + 1]):
                codes[k] = image[q] * n + image[other]
                k += 1
