"""Results of adjustments: a block adjusted, or a folder opened again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from aerotri.conventions import FilePath, InputError
from aerotri.public.adjustment import Adjustment
from aerotri.public.argument_types import with_checked_types
from aerotri.public.progress import ProgressLike, stage_report

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

    from aerotri.observations import Block

Robust = Literal["off", "huber", "danish", "cauchy", "adaptive", "data-snooping"]
Datum = Literal["control", "minimal", "inner", "fixed"]
Switch = Literal["off", "on"]
Start = Literal["auto", "strips", "points"]


@with_checked_types
def adjust(
    block: Block | FilePath,
    *,
    parameters: str | None = None,
    parameter_selection: Switch | None = None,
    robust: Robust | None = None,
    datum: Datum | None = None,
    variance_components: Switch | None = None,
    model_part: Switch | None = None,
    start: Start | None = None,
    max_iterations: int | None = None,
    check: Sequence[str] = (),
    points: np.ndarray | None = None,
    geoid: FilePath | None = None,
    explain: bool = True,
    progress: ProgressLike = None,
) -> Adjustment:
    """Adjust a block: orientation, points, self-calibration, and σ of everything.

    What is not given is as the settings of the block have it.

    Parameters
    ----------
    block : a block, or the folder of one.
    parameters : additional parameters, 'bluh:1-12,ultracam_d:42-73', 'brown:K1+K2', 'auto' (chosen by
        cross-validation) or 'none'.
    parameter_selection : 'on' takes out parameters that are not significant or cannot be told from others.
    robust : estimator that lowers the weight of gross errors; 'data-snooping' removes them one by one.
    datum : what fixes the block: its control, the 'minimal' or 'inner' datum of a free network, or 'fixed' elements.
    variance_components : 'on' estimates σ of every group of observations.
    model_part : 'on' tests whether strips or other groups of photographs share errors, and adds a model part to σ where
        they do.
    start : where start values of photographs without orientation come from: 'strips' (control, and strips along the
        track), 'points' (tie points alone, whatever the geometry; given orientations are not used), or 'auto'.
    max_iterations : at most, in each stage of a robust estimator.
    check : names of control points that become check points: they are compared, not used.
    points : (N, 3) m, start values of the object points, where known from elsewhere.
    geoid : grid of geoid undulations for a coordinate system that has none of its own.
    explain : look for the usual mistake behind a block that is not accepted, by adjusting it again with that mended;
        False saves the time where many blocks are adjusted. Not looked for where points are given.
    progress : True for a bar in the terminal or notebook; or a function that takes (stage, share), share 0 … 1 or None
        where it is not known.

    Returns
    -------
    Adjustment
        Look at its `verdict` first: a rejected result is returned too, so that it can be looked at.

    Raises
    ------
    InputError
        When a setting or an observation makes no sense; the message says what to do.
    AdjustmentFailedError
        When the observations do not determine the unknowns; the message names which.

    Examples
    --------
    >>> import aerotri
    >>> block = aerotri.simulate(aerotri.example_flight(), seed=1).block
    >>> result = aerotri.adjust(block, parameters="brown:K1+K2", robust="huber")
    >>> result.parameters["name"].tolist()
    ['brown.K1', 'brown.K2']
    """
    from aerotri.coordinates.metric import in_metres
    from aerotri.formats.assembly.assemble_control import block_with_check_points
    from aerotri.formats.block.unread import unread_in_words
    from aerotri.observations import Block
    from aerotri.pipeline import adjust_and_explain, adjust_keeping_system
    from aerotri.public.block_settings import with_settings
    from aerotri.public.blocks import as_block

    chosen = with_settings(
        block_with_check_points(as_block(block), check), parameters=parameters, parameter_selection=parameter_selection,
        robust=robust, datum=datum, variance_components=variance_components, model_part=model_part,
        start=start, max_iterations=max_iterations,
    )  # fmt: skip
    unread = () if isinstance(block, Block) else unread_in_words(Path(block))
    with stage_report(progress) as report:
        if points is not None:
            found = adjust_keeping_system(chosen, report.iteration, points, geoid, sets=report.set_of)
            return Adjustment(found, unread)
        metric, note = in_metres(chosen, geoid)
        if explain:
            found = adjust_and_explain(
                metric, report.iteration, geoid, lambda text: report.stage(text, None), report.set_of
            )
        else:
            found = adjust_keeping_system(metric, report.iteration, geoid=geoid, sets=report.set_of)
        return Adjustment(found, (*((note,) if note else ()), *unread))


@with_checked_types
def open_result(folder: FilePath, progress: ProgressLike = None) -> Adjustment:
    """A result that was saved: linearised and factorised once at its solution, never adjusted again.

    Parameters
    ----------
    folder : written by `Adjustment.save` or by `aerotri adjust`. progress : see `aerotri.adjust`.

    Returns
    -------
    Adjustment

    Raises
    ------
    InputError
        When the folder is no result, or its adjustment has not converged.

    Examples
    --------
    >>> import aerotri, tempfile
    >>> result = aerotri.adjust(aerotri.simulate(aerotri.example_flight(), seed=1).block)
    >>> with tempfile.TemporaryDirectory() as place:
    ...     again = aerotri.open_result(result.save(f"{place}/result", plots=False))
    >>> abs(again.sigma0 - result.sigma0) < 1e-9
    True
    """
    from aerotri import opening
    from aerotri.coordinates.georeference import is_projected

    with stage_report(progress) as report:
        report.stage("reading", None)
        found = opening.open_result(folder)
    status, crs = found.solution.status, found.result.block.crs
    if status != "converged":
        raise InputError(f"the adjustment ended '{status}'", "give the result of a converged one", folder)
    if crs != "local" and not is_projected(crs):
        remedy = "adjust the block again: `aerotri adjust` brings it to metres"
        raise InputError(f"the result is in {crs}, which counts in degrees", remedy, folder)
    return Adjustment(found, folder=Path(folder))
