"""Why a block does not fit: the usual mistakes tried one after the other, and the one that explains it said.

A model is built from the image points alone (`free_model`). Photographs that do not fit it are tried with changed
measurements; the model is laid on what is given, as it is and with every usual mistake undone (`evidence`). What fits
clearly better is put to the proof: the changed block is adjusted. Only what makes the block clearly better is said.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.prepare import with_edits
from aerotri.conventions import InputError
from aerotri.coordinates import LocalFrame
from aerotri.coordinates.blocks import frame_of_block, transform_block
from aerotri.diagnosis import catalogue, focal_length, residual_patterns
from aerotri.diagnosis.evidence import Evidence, Fit, fit, gather, places_by_others
from aerotri.diagnosis.free_model import FreeModel, connected_parts, free_model
from aerotri.diagnosis.groups import of_groups
from aerotri.diagnosis.hypothesis import Hypothesis
from aerotri.diagnosis.photographs import try_photographs, unjoined
from aerotri.diagnosis.sampling import sampled
from aerotri.diagnosis.trials import (
    CLEARLY_BETTER,
    FAILED,
    NEARLY_ALL,
    Adjust,
    Trial,
    completed,
    explains,
    in_words,
    order,
    trial_of,
    try_adjusting,
)
from aerotri.functional_model.additional_parameters import AUTO
from aerotri.functional_model.rotation import angles_from_rotation
from aerotri.observations import Block
from aerotri.results.adjusted_block import AdjustedBlock

MOST_TRIED = 5
"""Hypotheses that are put to the proof by an adjustment."""
CHEAPER = 0.25
"""Doublings of the tolerance by which a hypothesis has to bring the misfits down before it is adjusted."""
AS_GOOD = 0.15
"""Difference of cost up to which two hypotheses explain the same."""
PARTIAL = 0.3
"""Cost of leaving positions out: what brings them to fit is preferred. And the cost over the least up to which a group
of photographs is tried."""
SECONDS = 60.0
"""Time after which nothing new is tried. Some seconds are usual; on no machine should the clock choose what is said."""


@dataclass(frozen=True, eq=False)
class _Search:
    """What every step of the search needs: the model of the image points, the trial of the block as it is."""

    model: FreeModel
    adjust: Adjust
    before: Trial
    frame: LocalFrame | None
    until: float
    focal_length_mm: tuple[float, ...]

    @property
    def is_over(self) -> bool:
        return time.monotonic() > self.until

    def local(self, block: Block) -> Block | None:
        """The block in a local frame; None where its coordinates cannot be brought there."""
        if block.crs == "local":
            return block
        for known in (self.frame, None):
            try:
                return transform_block(block, known or frame_of_block(block))
            except InputError:
                continue
        return None


@dataclass(frozen=True, eq=False)
class _Candidate:
    hypothesis: Hypothesis
    cost: float
    block: Block


def diagnose(
    block: Block,
    adjust: Adjust,
    result: AdjustedBlock | None = None,
    frame: LocalFrame | None = None,
    seconds: float = SECONDS,
) -> tuple[str, ...]:
    """What explains a block that is doubted, rejected or has no result; empty where nothing does.

    Parameters
    ----------
    block : as it was given. adjust : what adjusts a block (`aerotri.pipeline.adjust`).
    result : its adjustment where there is one. frame : a local frame near the block where it has a CRS.
    seconds : after this time nothing new is begun; the block as it is does not count.
    """
    whole, plain = block, _without_choices(block)
    block = _with_decisions(plain)
    said = _parts_in_words(block)
    if said:
        return said
    block, is_sample = sampled(block, result)
    before = FAILED
    if is_sample or (result is not None and plain is not whole):
        before = try_adjusting(block, adjust)
    elif result is not None:
        before = trial_of(result)
    until = time.monotonic() + seconds
    model = free_model(block)
    if model is None or model.joined.sum() < 3:
        return ()
    given = tuple(camera.focal_length_mm for camera in block.cameras)
    search = _Search(model, adjust, before, frame, until, given)
    return _of_groups(block, search) or _of_photographs(block, search) or _of_the_block(block, search)


def _without_choices(block: Block) -> Block:
    """The block without what makes an adjustment long: choices, variance components, snooping, model part of σ."""
    own = block.settings.adjustment
    chosen = () if own.additional_parameters == AUTO else own.additional_parameters
    robust = "huber" if own.robust == "data-snooping" else own.robust
    plain = replace(
        own,
        additional_parameters=chosen,
        parameter_selection="off",
        variance_components="off",
        model_part="off",
        robust=robust,
    )
    return block if plain == own else replace(block, settings=replace(block.settings, adjustment=plain))


def _with_decisions(block: Block) -> Block:
    """The block as the operator's decisions leave it."""
    decided, off = with_edits(block)
    if off.any():
        rays = decided.image_points
        kept = ~off
        decided = replace(
            decided,
            image_points=replace(
                rays, image=rays.image[kept], point=rays.point[kept], xy=rays.xy[kept], sigma=rays.sigma[kept]
            ),
        )
    return replace(decided, edits=None)


def _parts_in_words(block: Block) -> tuple[str, ...]:
    """The parts of a block that no common point ties together."""
    parts = connected_parts(block)
    if len(parts) < 2:
        return ()
    names, strip = block.images.names.astype(str), np.asarray(block.images.strip)
    said = []
    for part in parts[:4]:
        own = np.unique(strip[part])
        whole = len(own) <= 3 and all(s and np.isin(np.flatnonzero(strip == s), part).all() for s in own)
        if whole:
            said.append(f"strip{'s' if len(own) > 1 else ''} {', '.join(own)}")
        else:
            more = f" and {len(part) - 3} more" if len(part) > 3 else ""
            said.append(f"{len(part)} photograph{'s' if len(part) > 1 else ''} ({', '.join(names[part[:3]])}{more})")
    rest = " …" if len(parts) > 4 else ""
    return (
        f"the photographs fall into {len(parts)} parts without a common point: {'; '.join(said)}{rest}: check the "
        "names of the points",
    )


def _of_groups(block: Block, search: _Search) -> tuple[str, ...]:
    """Strips or cameras whose measurements fit the others with an axis turned round."""
    candidates = []
    for hypothesis in of_groups(block, search.model):
        changed = hypothesis.change(block)
        local, model = search.local(changed), free_model(changed)
        if candidates and search.is_over:
            break
        if local is None or model is None or model.joined.mean() < NEARLY_ALL:
            continue
        found = fit(gather(local, model))
        candidates.append(_Candidate(hypothesis, found.cost, _with_start(changed, model, found)))
    least = min((candidate.cost for candidate in candidates), default=0.0)
    likely = [candidate for candidate in candidates if candidate.cost <= least + PARTIAL]
    return _proven(sorted(likely, key=lambda candidate: candidate.cost), search)


def _of_photographs(block: Block, search: _Search) -> tuple[str, ...]:
    """Photographs whose measurements are changed so that they fit."""
    model, before = search.model, search.before
    found = try_photographs(block, model)
    if not found:
        return ()
    tried: list[tuple[Trial, list[Hypothesis]]] = []
    for choice in range(max(len(trial.hypotheses) for trial in found)):
        chosen = [trial.hypotheses[min(choice, len(trial.hypotheses) - 1)] for trial in found]
        better = block
        for hypothesis in chosen:
            better = hypothesis.change(better)
        after = try_adjusting(_with_start(better, free_model(better) or model), search.adjust)
        if explains(before, after):
            tried.append((after, chosen))
        if explains(before, after) and after.rank == 0:
            break
    if not tried:
        return ()
    after, chosen = min(tried, key=lambda pair: order(pair[0]))
    return tuple(in_words(hypothesis, before, after) for hypothesis in chosen)


def _with_start(block: Block, model: FreeModel, found: Fit | None = None) -> Block:
    """The block with start values from the placed model where it has none."""
    if block.crs != "local":
        return block
    placed = (found or fit(gather(block, model))).placed
    if placed is None:
        return block
    centre = placed(model.centre)
    angles = np.full_like(centre, np.nan)
    joined = model.joined
    angles[joined] = angles_from_rotation(placed.rotation @ model.rotation[joined], block.rotation)
    return completed(block, centre, angles)


def _of_the_block(block: Block, search: _Search) -> tuple[str, ...]:
    """Mistakes in what is given, in all measurements or in the camera."""
    model, local = search.model, search.local(block)
    now = None if local is None else fit(gather(local, model))
    cost_now = np.inf if now is None or now.placed is None else now.cost
    candidates: list[_Candidate] = []
    for hypothesis in _hypotheses(block, local, model, now):
        if search.is_over:
            break
        candidate = _costed(block, hypothesis, search)
        partly = hypothesis.remedy.endswith("left out")
        if candidate is not None and (partly or candidate.cost <= cost_now - CHEAPER):
            candidates.append(candidate)
    candidates += _left_out(block, search)
    candidates.sort(key=lambda c: c.cost)
    return _proven(candidates[:MOST_TRIED], search)


def _left_out(block: Block, search: _Search) -> list[_Candidate]:
    """The block without the photographs whose measurements fit nothing."""
    wrong = unjoined(block, search.model)
    if not 0 < len(wrong) <= max(2, len(block.images) // 10):
        return []
    names = ", ".join(str(name) for name in block.images.names[wrong])
    plural = "s" if len(wrong) > 1 else ""

    def change(block: Block) -> Block:
        rays = block.image_points
        kept = ~np.isin(rays.image, wrong)
        return replace(
            block,
            image_points=replace(
                rays, image=rays.image[kept], point=rays.point[kept], xy=rays.xy[kept], sigma=rays.sigma[kept]
            ),
        )

    hypothesis = Hypothesis(
        "block", f"photograph{plural} {names} left out", change, plural=False,
        note="the measurements there fit the others in none of the usual ways",
    )  # fmt: skip
    costed = _costed(block, hypothesis, search)
    return [replace(costed, cost=costed.cost + PARTIAL)] if costed is not None else []


def _hypotheses(block: Block, local: Block | None, model: FreeModel, now: Fit | None) -> Iterator[Hypothesis]:
    places = {}
    if local is not None and now is not None and now.placed is not None:
        evidence = gather(local, model)
        places = places_by_others(evidence)
        yield from residual_patterns.of_single_positions(block, evidence, now)
        yield from residual_patterns.of_single_attitudes(block, evidence, now)
        yield from residual_patterns.of_offsets(evidence)
    if local is not None:

        def evidence_of(changed: FreeModel) -> Evidence:
            return gather(local, changed)

        yield from focal_length.of_focal_length(block, model, evidence_of)
    yield from focal_length.of_inner_fit(block, model)
    yield from catalogue.of_measurements()
    yield from catalogue.of_positions(block, places)
    yield from catalogue.of_angles(block)


def _costed(block: Block, hypothesis: Hypothesis, search: _Search) -> _Candidate | None:
    """The hypothesis with what it leaves of the misfits; None where the model cannot be laid on what is given."""
    model, changed = search.model, hypothesis.change(block)
    local = search.local(changed)
    if local is None:
        return None
    seen = model if hypothesis.on_model is None else hypothesis.on_model(model)
    found = fit(gather(local, seen))
    if found.placed is None:
        return None
    cost = found.cost + (PARTIAL if hypothesis.remedy.endswith("left out") else 0.0)
    return _Candidate(hypothesis, cost, _with_start(changed, seen, found))


def _proven(candidates: list[_Candidate], search: _Search) -> tuple[str, ...]:
    """The hypotheses whose adjustment is best, in words."""
    tried: list[tuple[_Candidate, Trial]] = []
    for candidate in candidates:
        if tried and search.is_over:
            break
        after = try_adjusting(candidate.block, search.adjust)
        if explains(search.before, after):
            tried.append((candidate, after))
    if not tried:
        return ()
    tried = _equally_good(tried)
    best, after = tried[0]
    said = _sentence(best.hypothesis, search, after)
    same = [
        c.hypothesis for c, _ in tried[1:]
        if abs(c.cost - best.cost) < AS_GOOD
    ]  # fmt: skip
    if same:
        said += "; the same fit: " + "; ".join(
            ("" if h.subject == "block" else f"{h.subject} with ") + h.remedy for h in same[:2]
        )
    return (said,)


def _equally_good(tried: list[tuple[_Candidate, Trial]]) -> list[tuple[_Candidate, Trial]]:
    """Those with the best verdict, the most rays and a misfit near the least; the one that leaves least open first."""
    rank, used = min(t.rank for _, t in tried), max(t.used for _, t in tried)
    good = [pair for pair in tried if pair[1].rank == rank and pair[1].used >= NEARLY_ALL * used]
    good = good or tried
    least = max(min(t.misfit for _, t in good), 1.0)
    return sorted((pair for pair in good if pair[1].misfit <= CLEARLY_BETTER * least), key=lambda pair: pair[0].cost)


def _sentence(hypothesis: Hypothesis, search: _Search, after: Trial) -> str:
    given = search.focal_length_mm
    if hypothesis.free_focal and len(after.focal_length_mm) == len(given):
        told = ", ".join(
            f"{found / was:.4g} times the principal distance, {found:.5g} mm in place of {was:.5g} mm"
            for found, was in zip(after.focal_length_mm, given, strict=True)
        )
        hypothesis = replace(hypothesis, remedy=f"{told}; a wrong size of a pixel would look the same")
    said = in_words(hypothesis, search.before, after)
    return f"{hypothesis.note}: {said}" if hypothesis.note else said
