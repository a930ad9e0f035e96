"""Kernels of the response of a height functional to the orientation: scalar functions without checks or objects."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import kernel
from aerotri.functional_model._kernels import INTERIOR, linearise_ray, predict_ray
from aerotri.functional_model._scan_kernels import place_in_scan, scan_partials

MOST_OF_SCAN = 7
"""Shared parameters of a ray by its rolling shutter: readout time, velocity, rates of rotation."""
STEPS = 3
"""Steps of the fixed point of a measured position [C]: each leaves a hundredth."""


class PhotoArrays(NamedTuple):
    """n photographs; `lens_row` and `source` say which interior elements and which group of image errors are theirs.

    scan_rate (n, 2), readout (n), velocity and spin (n, 3), scan_columns (n, 3) are those of `Scans`, 0 and −1 without
    rolling shutter.
    """

    rotation: np.ndarray
    centre: np.ndarray
    interior: np.ndarray
    lens_row: np.ndarray
    source: np.ndarray
    scan_rate: np.ndarray
    readout: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    scan_columns: np.ndarray


class Tiles(NamedTuple):
    """The tiles of S groups of image errors.

    Parameters
    ----------
    edges : (S, 2, 2) mm, x and y of the seams, rising, ∞ where there is none.
    meta : (S, 3, 3, 7) of every tile (column, row from below): offset into the nodes, nodes along x and y, x and y of
        the first node, nodes per mm.
    """

    edges: np.ndarray
    meta: np.ndarray


class PicketArrays(NamedTuple):
    """k pickets, r rays: start (k + 1), image (r), inv_sigma (r) 1/mm, points, gradient (k, 3), noise_share (k).

    gradient : of the functional by X, Y, Z of the picket.
    """

    start: np.ndarray
    image: np.ndarray
    inv_sigma: np.ndarray
    points: np.ndarray
    gradient: np.ndarray
    noise_share: np.ndarray


class ResponseSums(NamedTuple):
    """Sums of the response, out: by_eo (n, 6), by_interior (L, 24), nodes (·, 2), noise (1,).

    by_shared : (s,) by the unknowns of rolling shutters. moved : (1,) by the motion of photographs, left uncorrected.
    """

    by_eo: np.ndarray
    by_interior: np.ndarray
    nodes: np.ndarray
    noise: np.ndarray
    by_shared: np.ndarray
    moved: np.ndarray


class Views(NamedTuple):
    """n photographs: rotation (n, 3, 3), centre (n, 3), interior (n, 3) c, x0, y0 and half a format (n, 2) mm."""

    rotation: np.ndarray
    centre: np.ndarray
    interior: np.ndarray
    half: np.ndarray


@kernel
def deposit(s, x, y, force, tiles, nodes):
    """Spread a force (2) over the four nodes around an image position, never across a seam."""
    edges, meta = tiles.edges, tiles.meta
    f0, f1 = force
    i = int(x >= edges[s, 0, 0]) + int(x >= edges[s, 0, 1])
    j = int(y >= edges[s, 1, 0]) + int(y >= edges[s, 1, 1])
    nx, ny = int(meta[s, i, j, 1]), int(meta[s, i, j, 2])
    fx, fy = (x - meta[s, i, j, 3]) * meta[s, i, j, 5], (y - meta[s, i, j, 4]) * meta[s, i, j, 6]
    kx, ky = min(max(int(fx), 0), nx - 2), min(max(int(fy), 0), ny - 2)
    fx, fy = fx - kx, fy - ky
    low = int(meta[s, i, j, 0]) + ky * nx + kx
    for at, weight in (
        (low, (1.0 - fx) * (1.0 - fy)), (low + 1, fx * (1.0 - fy)), (low + nx, (1.0 - fx) * fy), (low + nx + 1, fx * fy)
    ):  # fmt: skip
        nodes[at, 0] += weight * f0
        nodes[at, 1] += weight * f1


@kernel
def settle_ray(photos, i, point, place, centre, rotation, at, xy):
    """The ray of a point in photograph i: measured position, and how much later than the middle it is exposed, s.

    Parameters
    ----------
    place : the measured position is needed for it. centre : (3,), rotation : (3, 3), at its exposure, out.
    at : (2,) measured position, xy : (2,) what it were if the camera stood still, out.
    """
    row = photos.interior[photos.lens_row[i]]
    rate, tau = photos.scan_rate[i], 0.0
    scans = rate[0] != 0.0 or rate[1] != 0.0
    centre[:], rotation[:] = photos.centre[i], photos.rotation[i]
    x, y = row[1], row[2]
    at[0], at[1] = x, y
    if place or scans:
        for _ in range(STEPS):
            predict_ray(rotation, centre, point, row, x, y, at)
            x, y = at[0], at[1]
    xy[0], xy[1] = at[0], at[1]
    if scans:
        for _ in range(STEPS):
            tau = (rate[0] * x + rate[1] * y) * photos.readout[i]
            place_in_scan(
                tau, photos.rotation[i], photos.centre[i], photos.velocity[i], photos.spin[i], centre, rotation
            )
            predict_ray(rotation, centre, point, row, x, y, at)
            x, y = at[0], at[1]
    return tau


@kernel
def respond(first, last, pickets, photos, tiles, out):
    """Add pickets first..last: f = W·A·N⁻¹·g of every ray; by_eo −= Bᵀf, nodes += f, noise += share·gᵀN⁻¹g.

    Returns the row of a picket whose rays do not determine it, −1 if there is none.
    """
    start, image, inv_sigma, points = pickets.start, pickets.image, pickets.inv_sigma, pickets.points
    gradient, noise_share = pickets.gradient, pickets.noise_share
    interior, lens_row = photos.interior, photos.lens_row
    moved_centre, turned, unmoved = np.empty(3), np.empty((3, 3)), np.empty((2,))
    by_eo_sum, by_interior_sum, nodes, noise = out.by_eo, out.by_interior, out.nodes, out.noise
    most = 1
    for p in range(first, last):
        most = max(most, start[p + 1] - start[p])
    by_eo, by_pt, by_in = np.empty((most, 2, 6)), np.empty((most, 2, 3)), np.empty((most, 2, INTERIOR))
    at, normal, q = np.empty((most, 2)), np.empty((3, 3)), np.empty(3)
    by_scan, place, count_of = (
        np.empty((most, 2, MOST_OF_SCAN)),
        np.empty((most, MOST_OF_SCAN), np.int64),
        np.empty(most, np.int64),
    )
    way = np.zeros((most, 2))
    for p in range(first, last):
        normal[:] = 0.0
        count = start[p + 1] - start[p]
        for r in range(count):
            i = image[start[p] + r]
            row = interior[lens_row[i]]
            brown = False
            for t in range(3, 10):
                brown |= row[t] != 0.0
            tau = settle_ray(photos, i, points[p], brown, moved_centre, turned, at[r], unmoved)
            x, y = at[r, 0], at[r, 1]
            linearise_ray(turned, moved_centre, points[p], row, x, y, at[r], by_eo[r], by_pt[r], by_in[r], INTERIOR)
            rate, count_of[r] = photos.scan_rate[i], 0
            if rate[0] != 0.0 or rate[1] != 0.0:
                way[r, 0], way[r, 1] = at[r, 0] - unmoved[0], at[r, 1] - unmoved[1]
                count_of[r] = scan_partials(
                    rate[0] * x + rate[1] * y, tau, photos.rotation[i], photos.velocity[i], photos.spin[i], by_eo[r],
                    photos.scan_columns[i], by_scan[r], place[r], 0,
                )  # fmt: skip
            else:
                way[r, 0], way[r, 1] = 0.0, 0.0
            weight = inv_sigma[start[p] + r] ** 2
            for a in range(3):
                for b in range(3):
                    normal[a, b] += weight * (by_pt[r, 0, a] * by_pt[r, 0, b] + by_pt[r, 1, a] * by_pt[r, 1, b])
        c00 = normal[1, 1] * normal[2, 2] - normal[1, 2] * normal[1, 2]
        c01 = normal[0, 2] * normal[1, 2] - normal[0, 1] * normal[2, 2]
        c02 = normal[0, 1] * normal[1, 2] - normal[0, 2] * normal[1, 1]
        c11 = normal[0, 0] * normal[2, 2] - normal[0, 2] * normal[0, 2]
        c12 = normal[0, 1] * normal[0, 2] - normal[0, 0] * normal[1, 2]
        c22 = normal[0, 0] * normal[1, 1] - normal[0, 1] * normal[0, 1]
        det = normal[0, 0] * c00 + normal[0, 1] * c01 + normal[0, 2] * c02
        if count < 2 or not det > 1e-12 * normal[0, 0] * normal[1, 1] * normal[2, 2]:
            return p
        g0, g1, g2 = gradient[p, 0], gradient[p, 1], gradient[p, 2]
        q[0] = (c00 * g0 + c01 * g1 + c02 * g2) / det
        q[1] = (c01 * g0 + c11 * g1 + c12 * g2) / det
        q[2] = (c02 * g0 + c12 * g1 + c22 * g2) / det
        noise[0] += noise_share[p] * (g0 * q[0] + g1 * q[1] + g2 * q[2])
        for r in range(count):
            i = image[start[p] + r]
            weight = inv_sigma[start[p] + r] ** 2
            f0 = weight * (by_pt[r, 0, 0] * q[0] + by_pt[r, 0, 1] * q[1] + by_pt[r, 0, 2] * q[2])
            f1 = weight * (by_pt[r, 1, 0] * q[0] + by_pt[r, 1, 1] * q[1] + by_pt[r, 1, 2] * q[2])
            for t in range(6):
                by_eo_sum[i, t] -= by_eo[r, 0, t] * f0 + by_eo[r, 1, t] * f1
            for t in range(INTERIOR):
                by_interior_sum[lens_row[i], t] -= by_in[r, 0, t] * f0 + by_in[r, 1, t] * f1
            for t in range(count_of[r]):
                out.by_shared[place[r, t]] -= by_scan[r, 0, t] * f0 + by_scan[r, 1, t] * f1
            out.moved[0] += way[r, 0] * f0 + way[r, 1] * f1
            deposit(photos.source[i], at[r, 0], at[r, 1], (f0, f1), tiles, nodes)
    return -1


@kernel
def shows(i, point, views):
    """Whether photograph i has a point (3,) within its format."""
    rotation, centre, interior, half = views.rotation, views.centre, views.interior, views.half
    dx, dy, dz = point[0] - centre[i, 0], point[1] - centre[i, 1], point[2] - centre[i, 2]
    u = -(rotation[i, 0, 2] * dx + rotation[i, 1, 2] * dy + rotation[i, 2, 2] * dz)
    if u <= 0.0:
        return False
    scale = interior[i, 0] / u
    across = rotation[i, 0, 0] * dx + rotation[i, 1, 0] * dy + rotation[i, 2, 0] * dz
    along = rotation[i, 0, 1] * dx + rotation[i, 1, 1] * dy + rotation[i, 2, 1] * dz
    x, y = interior[i, 1] + scale * across, interior[i, 2] + scale * along
    return abs(x) <= half[i, 0] and abs(y) <= half[i, 1]


@kernel
def angle_between(point, one, other):
    """Radians between the rays from a point (3,) to two centres (3,)."""
    ax, ay, az = one[0] - point[0], one[1] - point[1], one[2] - point[2]
    bx, by, bz = other[0] - point[0], other[1] - point[1], other[2] - point[2]
    cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return np.arctan2(np.sqrt(cx * cx + cy * cy + cz * cz), ax * bx + ay * by + az * bz)


@kernel
def partner_of(first, point, candidates, views, least, weakest):
    """The nearest photograph whose ray makes an angle with that of the first, −1 where none has the weakest.

    Where none has the least, that of the largest angle.
    """
    centre = views.centre
    nearest, widest, away_of_nearest, largest = -1, -1, np.inf, weakest
    for i in candidates:
        dx, dy = point[0] - centre[i, 0], point[1] - centre[i, 1]
        away = dx * dx + dy * dy
        if i == first or (away >= away_of_nearest) or not shows(i, point, views):
            continue
        angle = angle_between(point, centre[first], centre[i])
        if angle >= least:
            nearest, away_of_nearest = i, away
        elif angle >= largest:
            widest, largest = i, angle
    return nearest if nearest >= 0 else widest


@kernel
def nearest_photographs(points, block, first, candidate, views, least, weakest, chosen):
    """The photographs that see each point and whose centres are nearest to it in plan; −1 where there are fewer.

    The nearest is followed by the nearest of those whose rays make an angle of `least` with its own, or the largest
    angle where none does, then by the others by distance. Where no angle reaches `weakest`, the nearest is alone: the
    height of a point that was seen from one place is not known.

    points (k, 3); block (k) of candidates: candidate[first[b] : first[b + 1]]; angles in radians; chosen (k, m) out.
    """
    centre, m = views.centre, chosen.shape[1]
    distance = np.empty(m)
    for p in range(len(points)):
        own = candidate[first[block[p]] : first[block[p] + 1]]
        found = 0
        for i in own:
            dx, dy = points[p, 0] - centre[i, 0], points[p, 1] - centre[i, 1]
            away = dx * dx + dy * dy
            if (found == m and away >= distance[m - 1]) or not shows(i, points[p], views):
                continue
            at = min(found, m - 1)
            while at > 0 and distance[at - 1] > away:
                distance[at] = distance[at - 1]
                chosen[p, at] = chosen[p, at - 1]
                at -= 1
            distance[at] = away
            chosen[p, at] = i
            found = min(found + 1, m)
        if found >= 2 and angle_between(points[p], centre[chosen[p, 0]], centre[chosen[p, 1]]) < least:
            partner = partner_of(chosen[p, 0], points[p], own, views, least, weakest)
            at = found - 1
            for k in range(1, found):
                if chosen[p, k] == partner:
                    at = k
            while at > 1:
                chosen[p, at] = chosen[p, at - 1]
                at -= 1
            chosen[p, 1] = partner
            found = found if partner >= 0 else 1
        for at in range(found, m):
            chosen[p, at] = -1
