"""Loops over descriptors and tracks."""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel


@kernel
def two_best(similarity, first_row, row_best, row_two, column_best, column_two):
    """The two largest similarities of every row and, over all calls, of every column, and where the largest lies.

    similarity (a, n2) of rows first_row …; row_best (n1,) and column_best (n2,) int64; row_two (n1, 2) and
    column_two (n2, 2) float32, the largest and the second largest, to begin with −1.
    """
    for i in range(similarity.shape[0]):
        row = first_row + i
        one, two, at = np.float32(-1.0), np.float32(-1.0), -1
        for j in range(similarity.shape[1]):
            s = similarity[i, j]
            if s > one:
                two, one, at = one, s, j
            elif s > two:
                two = s
            if s > column_two[j, 0]:
                column_two[j, 1], column_two[j, 0], column_best[j] = column_two[j, 0], s, row
            elif s > column_two[j, 1]:
                column_two[j, 1] = s
        row_best[row], row_two[row, 0], row_two[row, 1] = at, one, two


@kernel
def thin_tracks(order, start, rays, cells_of_image, least, keep):
    """Take tracks in their order while one of their cells, or the whole of one of their photographs, lacks points.

    order (t,) tracks; start (t + 1,) into the rays: their image (m,) and cell (m,); cells_of_image (n, c) points taken
    so far, to begin with 0; least points of a cell, and of a photograph in the second round; keep (t,) bool, out.
    """
    image, cell = rays
    share, wanted = least
    total = np.zeros(cells_of_image.shape[0], np.int64)
    for second in (False, True):
        for k in range(len(order)):
            track = order[k]
            if keep[track]:
                continue
            needed = False
            for r in range(start[track], start[track + 1]):
                if second:
                    needed = needed or total[image[r]] < wanted
                else:
                    needed = needed or cells_of_image[image[r], cell[r]] < share
            if needed:
                keep[track] = True
                for r in range(start[track], start[track + 1]):
                    cells_of_image[image[r], cell[r]] += 1
                    total[image[r]] += 1
