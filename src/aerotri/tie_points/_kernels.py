"""Loops over descriptors and tracks."""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel


@kernel
def two_best(similarity, rows, columns, row_best, row_two, column_best, column_two):
    """The two largest similarities of every row and, over all calls, of every column, and where the largest lies.

    similarity (a, b) of rows (a,) and columns (b,) of all (n1,) and (n2,); row_best (n1,) and column_best (n2,) int64;
    row_two (n1, 2) and column_two (n2, 2) float32, the largest and the second largest, to begin with −1.
    """
    for i in range(len(rows)):
        row = rows[i]
        one, two, at = np.float32(-1.0), np.float32(-1.0), -1
        for j in range(len(columns)):
            s = similarity[i, j]
            if s > two:
                if s > one:
                    two, one, at = one, s, columns[j]
                else:
                    two = s
            column = columns[j]
            if s > column_two[column, 1]:
                if s > column_two[column, 0]:
                    column_two[column, 1], column_two[column, 0] = column_two[column, 0], s
                    column_best[column] = row
                else:
                    column_two[column, 1] = s
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
