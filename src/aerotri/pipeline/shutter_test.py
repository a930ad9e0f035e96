"""The test of a rolling shutter put into an adjustment."""

from __future__ import annotations

from dataclasses import replace

from aerotri.adjustment.scanning import READOUT
from aerotri.adjustment.solve import SolveOptions
from aerotri.pipeline.local import Report
from aerotri.pipeline.verdict import with_outcome
from aerotri.results.adjustment import Adjustment
from aerotri.strategies.shutter_test import tested_shutter


def with_shutter_test(found: Adjustment, report: Report | None = None) -> Adjustment:
    """The adjustment with the test of its rolling shutter, and what a user has to know of it among the warnings."""
    shutters = found.result.rolling_shutters
    if shutters is None or found.result.outcome.status != "converged":
        return found
    settings = found.system.unknowns.block.settings.adjustment
    robust = "huber" if settings.robust == "data-snooping" else settings.robust
    test = tested_shutter(found, SolveOptions(settings.max_iterations, robust, report))
    parameters = found.local.parameters
    total = {
        group: float(sigma)
        for name, group, sigma in zip(parameters.names, parameters.groups, parameters.total_sigma, strict=True)
        if name == READOUT
    }
    readouts = (replace(one, total_sigma_ms=total.get(one.camera, one.sigma_ms)) for one in shutters.readouts)
    shutters = replace(shutters, readouts=tuple(readouts))
    said = [one.sentence for one in shutters.readouts]
    if test is not None:
        said.append(test.sentence)
        shutters = replace(shutters, test=test)
    outcome = found.result.outcome
    found = with_outcome(found, replace(outcome, warnings=(*outcome.warnings, *said)))
    return replace(
        found,
        result=replace(found.result, rolling_shutters=shutters),
        local=replace(found.local, rolling_shutters=shutters),
    )
