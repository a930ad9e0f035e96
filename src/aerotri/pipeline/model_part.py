"""The model part of σ, put into an adjustment."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from aerotri.diagnosis.moving_errors import model_part_in_words
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.adjustment import Adjustment
from aerotri.results.in_crs import with_model_of
from aerotri.results.model_part import FIELD, GROUPS, ClusterTest, ModelPart
from aerotri.statistics.cluster_fields import root_of_field
from aerotri.statistics.cluster_test import LEVEL
from aerotri.statistics.clusters import PHOTOGRAPH
from aerotri.statistics.covariance import cofactors, inner_datum
from aerotri.statistics.model_part import (
    Excess,
    compare_few,
    compare_schemes,
    excess_of_clusters,
    excess_of_root,
    why_not,
    with_ratios,
)
from aerotri.statistics.summarise import OF_POINTS


def with_model_part(found: Adjustment) -> Adjustment:
    """The adjustment with the model part of σ where groups of photographs share errors; else why there is none."""
    begun = time.perf_counter()
    system, solution, sigma0 = found.system, found.solution, found.local.outcome.sigma0
    reason = why_not(system, solution, sigma0)
    if reason:
        return _with(found, replace(found.local, model_part=ModelPart(reason=reason)), begun)
    factor = system.factorise(solution.equations)
    schemes, tests = compare_schemes(system, solution, factor, sigma0)
    tests, fields = compare_few(system, solution, factor, schemes, tests, sigma0)
    part = ModelPart(level=LEVEL, tests=tests)
    chosen = _chosen(tests)
    if chosen is None:
        untested = all(test.reason for test in tests)
        reason = (
            tests[0].reason if untested and tests else "no group of photographs has errors that noise does not explain"
        )
        return _with(found, replace(found.local, model_part=replace(part, reason=reason)), begun)
    u, clusters = system.unknowns, schemes[chosen]
    part = replace(part, scheme=clusters.scheme, clusters=len(clusters), method=FIELD if chosen in fields else GROUPS)
    inner = None
    if u.block.settings.adjustment.datum == "inner" and u.motions.count:
        inner = inner_datum(system, solution.state, factor, solution.estimator)
    if chosen in fields:
        root = root_of_field(system, solution, factor, clusters, fields[chosen], inner)
        excess = excess_of_root(system, solution, root)
    elif inner is not None:
        q = cofactors(system, solution.state, factor, solution.estimator)
        excess = excess_of_clusters(system, solution, factor, clusters, sigma0, q.images, q.shared, q.points, inner)
    else:
        excess = excess_of_clusters(
            system, solution, factor, clusters, sigma0, factor.inverse_on_pattern().blocks[: len(u.images)].copy(),
            factor.border_inverse(), found.local.points.covariance[u.points] / sigma0**2,
        )  # fmt: skip
    return replace(_with(found, _spread_over_block(found, excess, part), begun), model=excess.root)


def _chosen(tests: tuple[ClusterTest, ...]) -> int | None:
    """The number of the scheme with the largest ratio of those that count; single photographs where no other does."""
    counting = [(test.scheme != PHOTOGRAPH, test.ratio, k) for k, test in enumerate(tests) if test.counts]
    return max(counting)[2] if counting else None


def _spread_over_block(found: Adjustment, excess: Excess, part: ModelPart) -> AdjustedBlock:
    """The local result with the model part in the rows of the block; zero where it has no covariance to go with."""
    u, local = found.system.unknowns, found.local
    points, images = np.full_like(local.points.covariance, np.nan), np.full_like(local.images.covariance, np.nan)
    points[u.points], images[u.images] = excess.points, excess.images
    kinds = np.array(u.shared.kinds, dtype=object).astype(str)
    own = np.flatnonzero(~np.isin(kinds, OF_POINTS))
    shared = np.zeros((len(local.parameters), len(local.parameters)))
    shared[: len(own), : len(own)] = excess.shared[np.ix_(own, own)]
    model = np.sqrt(np.diagonal(points, axis1=1, axis2=2))
    return replace(
        local,
        points=replace(local.points, model=points),
        images=replace(local.images, model=images),
        parameters=replace(local.parameters, model=shared),
        model_part=with_ratios(part, local.points.sigma, model),
    )


def _with(found: Adjustment, local: AdjustedBlock, begun: float) -> Adjustment:
    """The adjustment with the model part of `local` in both frames, told among the warnings, its time counted."""
    said = model_part_in_words(local.model_part) if local.model_part is not None else ""

    def told(result: AdjustedBlock) -> AdjustedBlock:
        o = result.outcome
        timings = dict(o.timings_s)
        if "statistics" in timings:
            timings["statistics"] += time.perf_counter() - begun
        warnings = o.warnings if not said or said in o.warnings else (*o.warnings, said)
        return replace(result, outcome=replace(o, warnings=warnings, timings_s=timings))

    local = told(with_model_of(local, local, None))
    result = local if found.frame is None else told(with_model_of(found.result, local, found.frame))
    return replace(found, local=local, result=result)
