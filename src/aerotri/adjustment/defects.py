"""Rank defects by name: which unknowns the observations leave free.

The null space of the reduced normal matrix is found by inverse iteration with a small regularisation; motions of the
whole block are named first, what remains by the unknowns that take part in it.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.datum import FREEDOMS, motions_of_images
from aerotri.adjustment.normal_equations import NormalEquations, NormalSystem
from aerotri.adjustment.sparse_cholesky import BorderedMatrix, NotPositiveDefiniteError
from aerotri.adjustment.unknowns import State

REGULARISATION = 1e-8
NULL_EIGENVALUE = 2e-11
SUSPECT_PIVOT = 1e-11
"""Pivot (relative to a unit diagonal) below which a defect is looked for."""
SUBSPACE = 14


def find_defects(system: NormalSystem, state: State, equations: NormalEquations) -> list[str]:
    """Sentences naming what is free; empty where the matrix has full rank."""
    dead = _dead_columns(system, equations.matrix)
    if dead:
        return [f"no ray depends on {', '.join(dead[:6])}" + (f" and {len(dead) - 6} more" if len(dead) > 6 else "")]
    scale, vectors = _null_space(system, equations.matrix)
    if vectors.shape[1] == 0:
        return []
    sentences, rest = _name_motions(system, state, scale, vectors)
    for vector in rest.T:
        part = np.abs(vector) / np.abs(vector).max()
        members = [system.unknowns.name_of(int(k)) for k in np.argsort(-part)[:4] if part[k] > 0.3]
        sentences.append("not determined: " + ", ".join(members))
    return sentences


def _dead_columns(system: NormalSystem, matrix: BorderedMatrix) -> list[str]:
    n = len(system.unknowns.images)
    diagonal = np.concatenate([np.diagonal(matrix.blocks[:n], axis1=1, axis2=2).ravel(), np.diagonal(matrix.corner)])
    return [system.unknowns.name_of(int(k)) for k in np.flatnonzero(~(diagonal > 0.0))]


def _null_space(system: NormalSystem, matrix: BorderedMatrix) -> tuple[np.ndarray, np.ndarray]:
    """Square roots of the diagonal, and the null vectors (size, k) of the matrix scaled by them."""
    n = len(system.unknowns.images)
    blocks, corner = matrix.blocks.copy(), matrix.corner.copy()
    diagonal = np.arange(6)
    scale = np.sqrt(np.concatenate([blocks[:n, diagonal, diagonal].ravel(), np.diagonal(corner)]))
    blocks[:n, diagonal, diagonal] *= 1.0 + REGULARISATION
    corner[np.diag_indices_from(corner)] *= 1.0 + REGULARISATION
    try:
        factor = system.symbolic.factorise(BorderedMatrix(blocks, matrix.border, corner))
    except NotPositiveDefiniteError:
        return scale, np.zeros((len(scale), 0))
    rng = np.random.default_rng(0)
    basis = np.linalg.qr(rng.normal(size=(len(scale), min(SUBSPACE, len(scale)))))[0]
    for _ in range(4):
        basis = np.linalg.qr(scale[:, None] * factor.solve(scale[:, None] * basis))[0]
    image = scale[:, None] * factor.solve(scale[:, None] * basis)
    eigenvalue, turn = np.linalg.eigh(basis.T @ image)
    return scale, (basis @ turn)[:, 1.0 / eigenvalue - REGULARISATION < NULL_EIGENVALUE]


def _name_motions(system, state, scale, vectors) -> tuple[list[str], np.ndarray]:
    """The motions of the whole block within the null space, and what is left of it."""
    n = len(state.centre)
    motions = np.zeros((len(scale), 7))
    motions[: 6 * n] = motions_of_images(state.centre).reshape(6 * n, 7)
    _add_shifts(system, motions, 6 * n)
    motions *= scale[:, None]
    motions /= np.linalg.norm(motions, axis=0)
    inside = np.linalg.norm(vectors.T @ motions, axis=0) > 0.999
    free = [name for name, free in zip(FREEDOMS, inside, strict=True) if free]
    mixed, combinations = _mixed_motions(motions, inside, vectors)
    free += mixed
    if not free:
        return [], vectors
    named = np.linalg.qr(np.hstack([motions[:, inside], combinations]))[0]
    left, size, _ = np.linalg.svd(vectors - named @ (named.T @ vectors), full_matrices=False)
    return [f"the datum is free in {', '.join(free)}"], left[:, size > 0.5]


def _mixed_motions(motions, inside, vectors) -> tuple[list[str], np.ndarray]:
    """Motions of the whole block that are none of the seven alone, such as a rotation about two control points."""
    pure = np.linalg.qr(motions[:, inside])[0] if inside.any() else motions[:, :0]
    span, scale, mix = np.linalg.svd(motions - pure @ (pure.T @ motions), full_matrices=False)
    span, mix = span[:, scale > 1e-8], mix[scale > 1e-8] / scale[scale > 1e-8, None]
    left, cosine, _ = np.linalg.svd(span.T @ vectors, full_matrices=False)
    shared = left[:, cosine > 0.999]
    weight = np.abs(mix.T @ shared)
    names = [
        "a combination of " + " and ".join(f for f, w in zip(FREEDOMS, column / column.max(), strict=True) if w > 0.05)
        for column in weight.T
    ]
    return names, span @ shared


def _add_shifts(system: NormalSystem, motions: np.ndarray, first: int) -> None:
    """A translation of the block takes the GNSS shifts along."""
    for column, name in enumerate(system.unknowns.shared.names):
        if name.startswith("gnss.shift_"):
            motions[first + column, "XYZ".index(name[-1])] = 1.0
