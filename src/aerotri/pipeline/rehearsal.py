"""Whether a block can be adjusted: start values and one step, without a result."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.datum import FREEDOMS, nothing_holds
from aerotri.adjustment.prepare import Prepared, prepare
from aerotri.adjustment.solve import SolveOptions
from aerotri.adjustment.weak_geometry import minimise_tied
from aerotri.conventions import FilePath, InputError
from aerotri.coordinates.blocks import frame_of_block, transform_block
from aerotri.diagnosis.control_points import doubts_of_control, doubts_with_orientation
from aerotri.diagnosis.doubts import defects_in_words
from aerotri.functional_model.additional_parameters import AUTO
from aerotri.observations import Block
from aerotri.pipeline.starting import with_start
from aerotri.statistics.summarise import count_observations


@dataclass(frozen=True)
class Rehearsal:
    """missing : why the block cannot be adjusted, () where it can. warnings : what the adjustment would say.

    doubts : what looks wrong in the control points and their marks, as far as there are start values.
    """

    missing: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()


def rehearse(block: Block, geoid: FilePath | None = None) -> Rehearsal:
    """Prepare the adjustment of a block, and make one step of it to see whether the observations determine it.

    Additional parameters that are yet to be chosen are left out.

    Parameters
    ----------
    geoid : grid of geoid undulations for a CRS that has none of its own.
    """
    adjustment = block.settings.adjustment
    if adjustment.additional_parameters == AUTO:
        adjustment = replace(adjustment, additional_parameters=())
        block = replace(block, settings=replace(block.settings, adjustment=adjustment))
    if not len(block.image_points):
        return Rehearsal(_nothing_there(block), doubts=doubts_of_control(block))
    try:
        started = with_start(block, geoid)
        block = started.block
        local = block if block.crs == "local" else transform_block(block, frame_of_block(block, geoid))
        prepared = prepare(local)
    except InputError as error:
        return Rehearsal((str(error),), doubts=doubts_of_control(block))
    system, doubts = prepared.system, _doubts(block, prepared)
    if nothing_holds(system.unknowns, system.extras):
        free = f"the datum is free in {', '.join(FREEDOMS)}"
        return Rehearsal((defects_in_words(system, [free]),), prepared.warnings, doubts)
    # one step: the rank is looked at before it
    looked, solution = minimise_tied(
        prepared, SolveOptions(1, "off", None), lambda one: count_observations(one).redundancy, whole=False
    )
    missing = (defects_in_words(looked.system, solution.defects),) if solution.defects else ()
    return Rehearsal(missing, (*started.messages, *looked.warnings), doubts)


def _doubts(block: Block, prepared: Prepared) -> tuple[str, ...]:
    """What is doubted of the control of a block, by the orientations that its adjustment starts from."""
    images, state = prepared.system.unknowns.images, prepared.state
    centre, rotation = np.full((len(block.images), 3), np.nan), np.full((len(block.images), 3, 3), np.nan)
    centre[images], rotation[images] = state.centre, state.rotation
    return doubts_with_orientation(block, centre, rotation)


def _nothing_there(block: Block) -> tuple[str, ...]:
    """What a block without image points lacks, all of it."""
    said = ["there are no image points: measure tie points, or give the photographs to aerotri tiepoints"]
    if not len(block.images):
        said.insert(0, "there are no photographs: give a row in images.csv for each")
    has_control = len(block.control) > block.control.is_check.sum()
    if block.settings.adjustment.datum == "control" and not has_control and block.gnss_ins is None:
        said.append(
            "there is no control: give control points in control.csv or positions in gnss_ins.csv, or set "
            'datum = "minimal" or "inner"'
        )
    return tuple(said)
