"""The normal system of a part, its shared photographs last; and what a part may not hold."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.prepare import check_settings
from aerotri.adjustment.ray_status import ray_status
from aerotri.adjustment.shared_priors import SharedPriors
from aerotri.adjustment.start_values import given_start
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import State
from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import FAMILIES
from aerotri.observations import Block
from aerotri.partition.placing import refuse_partly_known

IN_ONE_PIECE = "adjust the block in one piece: aerotri adjust of the block that was divided"
ROBUST = ("off", "huber")
"""Estimators: the others need steps that look at all rays of a photograph at once [C]."""
KINDS = ("interior", "additional", "gnss")
"""Kinds of shared parameters that may act in several parts."""


@dataclass(frozen=True, eq=False)
class PartSystem:
    """A part ready to be adjusted with the others.

    Parameters
    ----------
    system : its normal system; what is known beforehand of shared parameters is not in it.
    priors : of the shared parameters, as this part alone would know them.
    kept : (k,) rows of the system's photographs that other parts see as well, in the order of the system's root.
    ray_status : (m,) of the rays. warnings : sentences for the user.
    """

    system: NormalSystem
    priors: SharedPriors
    kept: np.ndarray
    ray_status: np.ndarray
    warnings: tuple[str, ...]


def part_system(block: Block, shared: np.ndarray, origin: np.ndarray) -> tuple[PartSystem, State]:
    """The system of a part and its start state.

    Parameters
    ----------
    shared : (n,) bool, photographs that other parts see as well.
    origin : (3,) m, the local origin of all parts.

    Raises
    ------
    InputError
        When the part holds what is adjusted in one piece only.
    """
    check_settings(block)
    refuse_what_parts_cannot(block)
    start = given_start(block, origin)
    status, warnings = ray_status(block, start)
    system, state = build_system(block, start, status, last=np.flatnonzero(shared))
    kinds = sorted(set(system.unknowns.shared.kinds) - set(KINDS))
    if kinds:
        raise InputError(f"parameters of the kind '{kinds[0]}' are not adjusted in parts", IN_ONE_PIECE)
    bare = copy(system)
    nothing = np.zeros(len(system.unknowns.shared))
    bare.priors = replace(
        system.priors, weight=nothing, fields=(), deviation_priors=(), position_errors=(), photograph_fields=()
    )
    kept = np.flatnonzero(shared[system.unknowns.images])
    return PartSystem(bare, system.priors, kept, status, tuple(warnings)), state


def refuse_robust(name: str) -> None:
    """Name an estimator that is not for a block in parts.

    Raises
    ------
    InputError
    """
    if name not in ROBUST:
        raise InputError(
            f'robust = "{name}" for a block in parts is not available', 'use "huber", or adjust the block in one piece'
        )


def refuse_what_parts_cannot(block: Block) -> None:
    """Name what needs the whole block at once.

    Raises
    ------
    InputError
    """
    s = block.settings
    refuse_robust(s.adjustment.robust)
    for family, items in s.adjustment.additional_parameters:
        by_height = [item for item in items if item in FAMILIES[family].needs_height]
        if by_height:
            raise InputError(
                f"{family}.{by_height[0]} counts from the mean ground of the whole block, which parts do not know",
                f"leave {family}:{by_height[0]} out, or adjust the block in one piece",
            )
    refuse_partly_known(block)
    known = np.isfinite(np.hstack([block.images.centre, block.images.angles])).all(axis=1)
    without = block.images.names[np.flatnonzero(~known)[:1]]
    held = bool((block.control.sigma[~block.control.is_check] == 0.0).any())
    families = {family for family, _ in s.adjustment.additional_parameters}
    chosen, fields = "auto" in families, "collocation" in families
    refused = [
        (len(without) > 0, f"photograph '{''.join(without)}' has no orientation to begin with",
         "give X0, Y0, Z0, omega, phi, kappa of every photograph in images.csv"),
        (s.adjustment.datum != "control", f'datum = "{s.adjustment.datum}" of a block in parts', IN_ONE_PIECE),
        (chosen, 'additional_parameters = "auto" of a block in parts',
         "choose them on a part, aerotri adjust parts/0000 --parameters auto, and state them in every block.toml"),
        (s.adjustment.parameter_selection != "off", "parameter_selection of a block in parts", IN_ONE_PIECE),
        (s.adjustment.variance_components != "off", "variance_components of a block in parts", IN_ONE_PIECE),
        (held, "control with σ = 0 in a block in parts", "give it a small σ, such as 0.001 m"),
        (bool(block.rigs), "rigs of a block in parts", IN_ONE_PIECE),
        (any(c.rolling_shutter is not None for c in block.cameras), "rolling shutters of a block in parts",
         IN_ONE_PIECE),
        (block.constraints is not None and len(block.constraints) > 0, "constraints of a block in parts", IN_ONE_PIECE),
        (block.edits is not None and len(block.edits) > 0, "edits.csv of a block in parts",
         "apply it before the block is divided"),
        ("off" not in (s.refraction, s.earth_curvature) or s.refraction != s.earth_curvature,
         "refraction or earth_curvature of a block in parts", IN_ONE_PIECE),
        (s.gnss.drift != "off" or s.gnss.time_offset != "off" or s.gnss.correlated != "off",
         "drift, time_offset or correlated errors of GNSS in a block in parts", IN_ONE_PIECE),
        (s.deviations.kind != "free", "deviations of groups in a block in parts", IN_ONE_PIECE),
        (fields and None in (s.collocation.sigma_um, s.collocation.length_mm),
         "a random field of unknown size in a block in parts", "state sigma_um and length_mm in [collocation]"),
        (s.ins.drift != "off", "drift of the INS in a block in parts", IN_ONE_PIECE),
        (s.photograph_fields.correlated != "off", "errors of single photographs in a block in parts", IN_ONE_PIECE),
    ]  # fmt: skip
    for wrong, what, remedy in refused:
        if wrong:
            raise InputError(what if what.startswith("photograph") else f"{what} is not available", remedy)
