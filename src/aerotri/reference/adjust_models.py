"""What adjustment.json says of rigs, GNSS errors that stay, and rolling shutters, key by key."""

from __future__ import annotations

from aerotri.reference.records import Item, Kind, of_axes, within


def movements() -> tuple[Item, ...]:
    """σ of the movements of a camera."""
    return (
        Item("rig", "text", "Name of the rig."),
        Item("camera", "text", "Camera."),
        Item("photographs", "whole", "Photographs of the camera that took part."),
        Item("movement_m", "number", "Standard deviation of its movements between exposures, an axis.", "m"),
        Item("s_movement_m", "number?", "Standard deviation of this, about; empty: no movement.", "m"),
        Item("movement_m_estimated", "yes/no", "Whether it was estimated from the block."),
        Item("movement_deg", "number", "Standard deviation of its rotations between exposures, an axis.", "deg"),
        Item("s_movement_deg", "number?", "Standard deviation of this, about; empty: no rotation.", "deg"),
        Item("movement_deg_estimated", "yes/no", "Whether it was estimated from the block."),
    )


def rigidity() -> tuple[Item, ...]:
    """Tests whether cameras keep their places on rigid rigs."""
    found = "Whether it is there, all tests of cameras taken together (Holm)."
    tests = (
        Item("what", "text", "What the camera may do.", values={
            "rotation": "turn", "position": "move, beyond what rotations explain"}),
        Item("stations", "whole", "Photographs of the camera that were tested."),
        Item("movement", "number?", "Standard deviation of its movements between exposures, an axis; degrees or m."),
        Item("movement_sigma", "number?", "Standard deviation of this."),
        Item("movement_p", "number?", "Probability of such residuals where the camera does not move."),
        Item("movement_found", "yes/no", found),
        Item("movement_detectable", "number?", "The movement that is found with the power of the block; degrees or m."),
        *of_axes("drift_{}", "number?", "Change about or along {} of the reference camera, from the first to the last "
                 "exposure; degrees or m.", "", ("x", "y", "z")),
        *of_axes("s_drift_{}", "number?", "Standard deviation of the change about or along {}.", "", ("x", "y", "z")),
        Item("drift_p", "number?", "Probability of such a change by chance."),
        Item("drift_found", "yes/no", found),
        Item("drift_detectable", "number?", "The change that is found with the power of the block; degrees or m."),
    )  # fmt: skip
    return (
        Item("rigidity", "object", "Tests whether cameras keep their places; where there are rigid rigs.",
             optional=True),
        Item("rigidity.alpha", "number", "Probability of a false alarm in all these tests together."),
        Item("rigidity.power", "number", "Probability with which what is called detectable is found."),
        Item("rigidity.stations", "whole", "Exposures that were tested, those with two photographs or more."),
        Item("rigidity.stations_found", "whole", "Exposures whose photographs do not stand to one another as the rig "
             "says."),
        Item("rigidity.cameras[]", "object", "One entry a camera."),
        Item("rigidity.cameras[].rig", "text", "Name of the rig."),
        Item("rigidity.cameras[].camera", "text", "Camera; the reference camera as well where there are two others."),
        Item("rigidity.cameras[].keeps_place", "yes/no", "Whether neither a movement nor a drift is found."),
        Item("rigidity.cameras[].says", "text", "The same in words."),
        Item("rigidity.cameras[].photographs_found", "whole", "Photographs that are out of their places."),
        Item("rigidity.cameras[].photograph_detectable_deg", "number?", "Rotation of a single photograph that is found "
             "with the power of the block.", "deg"),
        Item("rigidity.cameras[].tests[]", "object", "Tests of rotation and position."),
        *within("rigidity.cameras[].tests[]", *tests),
    )  # fmt: skip


def gnss_errors() -> tuple[Item, ...]:
    what: tuple[tuple[str, Kind, str, str], ...] = (
        ("source", "text", "Where these errors come from: given in block.toml, or estimated from the block; empty "
         "where positions are adjusted as independent.", ""),
        ("plan_m", "number", "Standard deviation of these errors in X and Y.", "m"),
        ("height_m", "number", "The same in Z.", "m"),
        ("time", "number?", "Time after which such an error has fallen to 37 %.", "as time_unit says"),
        ("time_unit", "text", "s, or exposures where the photographs have no times.", ""),
        ("noise_factor_plan", "number", "Factor of the standard deviations of single positions in plan.", ""),
        ("noise_factor_height", "number", "The same in height.", ""),
        ("likelihood_ratio", "number?", "How much better such errors explain the positions than more noise does.", ""),
        ("p", "number?", "Probability of as much by noise alone.", ""),
        ("level", "number?", "Probability with which noise alone is taken for such errors.", ""),
        ("neighbours", "number?", "Correlation of the residuals of photographs taken one after the other, where "
         "positions are adjusted as independent.", ""),
        ("neighbours_p", "number?", "Probability of such a correlation by noise alone.", ""),
        ("exposures", "whole", "Photographs with a position.", ""),
        ("flights", "whole", "Flights, or strips where the photographs have no times, in which these errors begin "
         "anew.", ""),
        ("nodes", "whole", "Times at which such an error of a coordinate is an unknown.", ""),
        ("reason", "text", "Why nothing was tested; else empty.", ""),
    )  # fmt: skip
    text = "Errors of GNSS positions that stay for a while; null where there are no positions."
    items = (Item(f"gnss_errors.{name}", kind, said, unit) for name, kind, said, unit in what)
    return (Item("gnss_errors", "object?", text), *items)


def photograph_fields() -> tuple[Item, ...]:
    what: tuple[tuple[str, Kind, str, str], ...] = (
        ("source", "text", "Where these errors come from: given in block.toml, or estimated from the block; empty "
         "where image points are adjusted as independent.", ""),
        ("sigma_um", "number", "Standard deviation of these errors.", "µm"),
        ("length_mm", "number?", "Distance in the photograph after which their correlation has fallen to 37 %.", "mm"),
        ("likelihood_ratio", "number?", "How much better such errors explain the image points than noise does.", ""),
        ("p", "number?", "Probability of as much by noise alone.", ""),
        ("level", "number?", "Probability with which noise alone is taken for such errors.", ""),
        ("nodes_x", "whole", "Nodes of the grid of a photograph along x, between which the error is linear.", ""),
        ("nodes_y", "whole", "The same along y.", ""),
        ("photographs", "whole", "Photographs with such errors.", ""),
        ("reason", "text", "Why nothing was estimated; else empty.", ""),
    )  # fmt: skip
    text = "Smooth errors of single photographs; null where block.toml does not ask for them."
    items = (Item(f"photograph_fields.{name}", kind, said, unit) for name, kind, said, unit in what)
    return (Item("photograph_fields", "object?", text), *items)


def ray_correlation() -> tuple[Item, ...]:
    what: tuple[tuple[str, Kind, str, str], ...] = (
        ("from_px", "number", "Least distance of the two image points.", "px"),
        ("to_px", "number", "Largest distance.", "px"),
        ("pairs", "whole", "Pairs of image points.", ""),
        ("x", "number?", "Correlation of their residuals in x; null where there are few pairs.", ""),
        ("y", "number?", "The same in y.", ""),
        ("s_x", "number?", "Standard deviation of x, from the scatter of the photographs.", ""),
        ("s_y", "number?", "Standard deviation of y.", ""),
    )
    text = "How much image points of one photograph that are near one another err alike."
    return (
        Item("ray_correlation", "object", text),
        Item("ray_correlation.classes[]", "object", "One entry a class of distances in the image."),
        *(Item(f"ray_correlation.classes[].{name}", kind, said, unit) for name, kind, said, unit in what),
        Item("ray_correlation.p", "number?", "Probability of such residuals if every image point errs by itself."),
        Item("ray_correlation.near_px", "number?", "Distance of the pairs that took part in this test.", "px"),
        Item("ray_correlation.reason", "text", "Why nothing was tested; else empty."),
    )


def rolling_shutters() -> tuple[Item, ...]:
    camera = "rolling_shutters.cameras[]"
    test, variant = "rolling_shutters.test", "rolling_shutters.test.variants[]"
    return (
        Item("rolling_shutters", "object", "Rolling shutters; where there are any.", optional=True),
        Item(camera, "object", "One entry a camera."),
        Item(f"{camera}.camera", "text", "Name of the camera."),
        Item(f"{camera}.readout_ms", "number", "Time from the exposure of the first row to that of the last.", "ms"),
        Item(f"{camera}.sigma_ms", "number", "Its standard deviation; 0: held.", "ms"),
        Item(f"{camera}.total_sigma_ms", "number", "The same with the model part.", "ms"),
        Item(f"{camera}.time_rounding_s", "number", "What the times of its photographs are rounded to; 0 where they "
             "are finer than seconds, or not used.", "s"),
        Item(f"{camera}.status", "text", "How it was found.", values={
            "estimated": "free", "weighted": "with an observed value", "fixed": "held"}),
        Item(f"{camera}.row_direction", "text", "Direction in which the rows are read."),
        Item(f"{camera}.photographs", "whole", "Photographs of the camera."),
        Item(f"{camera}.speed_m_s", "number", "Their median speed.", "m/s"),
        Item(f"{camera}.moved_m", "number", "Median way of the camera while a photograph is read.", "m"),
        Item(f"{camera}.velocities", "object", "Number of photographs by where their velocity comes from."),
        Item(f"{camera}.velocities.*", "whole", "See source in motion.csv."),
        Item(test, "object?", "Whether the block needs it; null where the readout time is held."),
        Item(f"{test}.verdict", "text", "The verdict.", values={
            "needed": "affinity and shear of the camera do not explain the image points as well",
            "not needed": "the readout time is zero within 3.29 σ",
            "within shared errors": "the readout time is zero within 3.29 times its total σ",
            "not told apart": "affinity and shear of the camera explain the image points as well"}),
        Item(f"{test}.total_t", "number?", "Readout time over its total standard deviation, with the model part."),
        Item(f"{test}.bends_heights", "yes/no", "Whether heights change shape by more than their σ although nothing "
             "speaks for the rolling shutter."),
        Item(f"{test}.height_change_m", "number?", "RMS change of heights by the rolling shutter beside a plane.", "m"),
        Item(f"{test}.height_sigma_m", "number?", "Median standard deviation of heights.", "m"),
        Item(f"{test}.gain", "number?", "How much smaller errors at control left out and at check points are than "
             "without a rolling shutter (1 − ratio)."),
        Item(f"{test}.gain_error", "number?", "Its standard error."),
        Item(variant, "object", "The block with each model."),
        Item(f"{variant}.name", "text", "The model.", values={
            "none": "no rolling shutter", "affinity": "b1 and b2 of brown instead", "rolling shutter": "as asked for",
            "both": "b1 and b2 besides"}),
        Item(f"{variant}.status", "text", "converged, or why it failed."),
        Item(f"{variant}.sigma0", "number?", "σ0."),
        Item(f"{variant}.bic", "number?", "Bayesian information criterion of the image points; smaller is better."),
        Item(f"{variant}.readout_t", "number?", "Readout time over its standard deviation."),
        Item(f"{variant}.control_rms", "object", "RMS at control points, each left out in turn.", "m"),
        *of_axes(f"{variant}.control_rms.{{}}", "number?", "In {}.", "m"),
        Item(f"{variant}.check_rms", "object", "RMS at check points.", "m"),
        *of_axes(f"{variant}.check_rms.{{}}", "number?", "In {}.", "m"),
    )  # fmt: skip
