"""The photographs of all parts, and their observed positions, in one list."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerotri.observations import GnssIns, Images


def images_together(given: Sequence[Images]) -> tuple[Images, list[np.ndarray]]:
    """All photographs, part by part, shared ones once; rows of those of every part."""
    row: dict[str, int] = {}
    row_of = [np.array([row.setdefault(n, len(row)) for n in one.names.tolist()], np.int64) for one in given]
    _, first = np.unique(np.concatenate(row_of), return_index=True)
    return Images(
        np.concatenate([one.names for one in given])[first],
        np.concatenate([one.camera for one in given])[first],
        np.concatenate([one.strip for one in given])[first],
        np.concatenate([one.centre for one in given])[first],
        np.concatenate([one.angles for one in given])[first],
        {name: np.concatenate([one.columns[name] for one in given])[first] for name in given[0].columns},
    ), row_of


def positions_together(given: Sequence[GnssIns | None], row_of: Sequence[np.ndarray]) -> GnssIns | None:
    """Observed positions of all parts: each stands in one; None where there are none.

    Parameters
    ----------
    row_of : rows of the photographs of every part among all.
    """
    there = [(gnss, rows) for gnss, rows in zip(given, row_of, strict=True) if gnss is not None and len(gnss)]
    if not there:
        return None
    return GnssIns(
        np.concatenate([rows[gnss.image] for gnss, rows in there]),
        np.concatenate([gnss.xyz for gnss, _ in there]),
        np.concatenate([gnss.sigma for gnss, _ in there]),
        np.concatenate([gnss.angles for gnss, _ in there]),
        np.concatenate([gnss.angles_sigma for gnss, _ in there]),
        np.concatenate([gnss.time for gnss, _ in there]),
    )
