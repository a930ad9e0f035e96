"""What deform, demcor, imgeo and crosscheck write."""

from __future__ import annotations

from aerotri.reference.head import ARGUMENTS, BLOCK, HEAD, HEAD_BESIDE_CRS
from aerotri.reference.records import DescribedFile, Item, of_axes, statistics

DEFORM, DEMCOR, IMGEO, CROSSCHECK = (f"folder of {name}" for name in ("deform", "demcor", "imgeo", "crosscheck"))
VARIANT = {
    "free": "orientation as adjusted with the additional parameters",
    "absorbed": "orientation as adjusted without them, which takes over a part of the errors",
}
PAIR = Item(
    "pair", "object?", "The two photographs, left and right; null for a model at a stated end lap.", optional=True
)


def _seam_names(prefix: str) -> tuple[Item, ...]:
    return (
        Item(f"{prefix}.first[]", "text", "Photographs of the first model."),
        Item(f"{prefix}.second[]", "text", "Photographs of the second model."),
    )


DEFORM_JSON = (
    *HEAD_BESIDE_CRS,
    BLOCK,
    Item(
        "kind",
        "text",
        "What was computed.",
        values={
            "pair": "a stereo model of the block",
            "normal case": "a model at a stated end lap",
            "block": "all models of the block",
        },
    ),
    Item("title", "text", "Title of the plots."),
    Item("variant", "text", "How the photographs are oriented.", values=VARIANT),
    PAIR,
    Item("pair[]", "text", "Name of a photograph.", optional=True),
    Item("group", "text", "Parameter group of the photographs.", optional=True),
    Item("crs", "text", "Coordinate system; model: along the base, for a stated end lap."),
    Item("ground", "text", "Ground that the model was computed over."),
    Item("end_lap", "number", "End lap of the model: 0.6 is 60 %.", optional=True),
    Item("base_mm", "number", "Base in the image.", "mm", optional=True),
    Item("base_m", "number", "Base in the air.", "m", optional=True),
    Item("height_m", "number", "Flying height over the ground.", "m", optional=True),
    Item("h_over_b", "number", "Height-to-base ratio.", optional=True),
    Item("gsd_m", "number", "Size of a pixel on the ground.", "m", optional=True),
    Item("cm_per_um", "number", "Height error for 1 µm of x-parallax.", "cm/µm", optional=True),
    Item("spacing_m", "number", "Distance between nodes.", "m"),
    Item("nodes", "whole", "Number of nodes inside the models."),
    *(one for axis in "XYZ" for one in statistics(f"d{axis}", f"the error of {axis} (wrong minus true)")),
    *(one for axis in "XYZ" for one in statistics(f"sigma_d{axis}", f"the standard deviation of the error of {axis}")),
    Item("sigma_includes", "text", "What the standard deviations contain."),
    Item("y_parallax_um", "object", "y-parallax that stays in the model.", "µm", optional=True),
    Item("y_parallax_um.max", "number", "Largest y-parallax.", "µm"),
    Item("y_parallax_um.rms", "number", "Root mean square y-parallax.", "µm"),
    Item("contour_interval_m", "number", "Interval of the contour lines of the plot.", "m"),
    Item("models[]", "object", "One entry a model, of a block.", optional=True),
    Item("models[].number", "whole", "Number of the model, as in model.tif."),
    Item("models[].left", "text", "Left photograph."),
    Item("models[].right", "text", "Right photograph."),
    Item("models[].h_over_b", "number", "Height-to-base ratio."),
    Item("models[].end_lap", "number", "End lap: 0.6 is 60 %."),
    Item("models[].cm_per_um", "number", "Height error for 1 µm of x-parallax.", "cm/µm"),
    Item("models[].nodes", "whole", "Nodes that lie nearest to this model."),
    Item("seams", "object", "Steps of dZ between neighbouring models, of a block.", optional=True),
    Item("seams.count", "whole", "Number of seams."),
    Item("seams.nodes", "whole", "Number of nodes on them."),
    Item("seams.rms", "number?", "Root mean square step.", "m"),
    Item("seams.worst[]", "object", "The seams with the largest steps."),
    *_seam_names("seams.worst[]"),
    Item("seams.worst[].nodes", "whole", "Nodes on the seam."),
    Item("seams.worst[].mean", "number", "Mean step, first less second.", "m"),
    Item("seams.worst[].rms", "number", "Root mean square step.", "m"),
    Item("seams.worst[].max", "number", "Largest step.", "m"),
    *ARGUMENTS,
)
MODELS = (
    Item("number", "whole", "Number of the model, as in model.tif."),
    Item("left", "text", "Left photograph."),
    Item("right", "text", "Right photograph."),
)
SEAMS = (
    Item("first_left", "text", "Left photograph of the first model."),
    Item("first_right", "text", "Right photograph of the first model."),
    Item("second_left", "text", "Left photograph of the second model."),
    Item("second_right", "text", "Right photograph of the second model."),
    Item("nodes", "whole", "Nodes on the seam."),
    Item("mean", "number", "Mean step of dZ, first less second.", "m"),
    Item("rms", "number", "Root mean square step.", "m"),
    Item("max", "number", "Largest step.", "m"),
)
LOW_HIGH_MEAN = ("min", "max", "mean")
DEMCOR_JSON = (
    *HEAD,
    BLOCK,
    Item("dem", "text", "File of the DEM before the correction."),
    Item("variant", "text", "How the photographs of the DEM were oriented.", values={**VARIANT, "given": "as stated"}),
    Item("models[]", "object", "The models that the DEM was made of."),
    Item("models[][]", "text", "Left and right photograph."),
    Item("cells", "whole", "Number of cells."),
    Item("corrected", "whole", "Cells that were corrected."),
    Item("no_data", "whole", "Cells without a height."),
    Item("outside_models", "whole", "Cells outside all models, left as they were."),
    *statistics("before", "the heights before", keys=LOW_HIGH_MEAN),
    *statistics("after", "the heights after", keys=LOW_HIGH_MEAN),
    *statistics("dZ", "the correction that was taken off"),
    *statistics("sigma_dZ", "the standard deviation of the correction"),
    Item("sigma_dZ.cell_m", "number", "Cell of the raster of these standard deviations.", "m"),
    Item("sigma_includes", "text", "What the standard deviations contain."),
    Item("seams", "object", "Steps of the heights at seams between models."),
    Item("seams.count", "whole", "Number of seams."),
    Item("seams.places", "whole", "Places at which they were measured."),
    Item("seams.rms_before", "number?", "Root mean square step before.", "m"),
    Item("seams.rms_after", "number?", "Root mean square step after.", "m"),
    Item("seams.worst[]", "object", "The seams with the largest steps."),
    *_seam_names("seams.worst[]"),
    Item("seams.worst[].places", "whole", "Places on the seam."),
    Item("seams.worst[].mean_before", "number", "Mean step before.", "m"),
    Item("seams.worst[].rms_before", "number", "Root mean square step before.", "m"),
    Item("seams.worst[].mean_after", "number", "Mean step after.", "m"),
    Item("seams.worst[].rms_after", "number", "Root mean square step after.", "m"),
    Item("accuracy_m", "object", "How exactly the correction was computed.", "m"),
    Item("accuracy_m.fit", "number", "Bound of the interpolation between exact places.", "m"),
    Item("accuracy_m.tables", "number", "Bound of the tables of the image errors.", "m"),
    Item("halo_cells", "whole", "Cells by which neighbouring windows overlapped."),
    Item("timings_s", "object", "Time by stage.", "s"),
    Item("timings_s.*", "number", "Time of a stage.", "s"),
    *ARGUMENTS,
)
IMGEO_JSON = (
    *HEAD,
    BLOCK,
    Item("sign", "text", "The sign of the image errors, in words."),
    Item("resampling", "text", "Interpolation of the grey values.", values={"bicubic": "", "lanczos": ""}),
    Item("groups[]", "object", "One entry a group of photographs with the same image errors."),
    Item("groups[].group", "text", "Name of the group."),
    Item("groups[].camera", "text", "Camera as in the block."),
    Item("groups[].ideal_camera", "text", "Camera of the photographs without image errors."),
    Item("groups[].focal_length_mm", "number", "Its principal distance.", "mm"),
    Item("groups[].x0_mm", "number", "x of its principal point.", "mm"),
    Item("groups[].y0_mm", "number", "y of its principal point.", "mm"),
    Item("groups[].d_rms_um", "number", "Root mean square length of the image error.", "µm"),
    Item("groups[].d_max_um", "number", "Largest image error.", "µm"),
    Item("groups[].correction_raster", "text", "Raster of the image errors."),
    Item("groups[].nearest[]", "object", "Lens models of other programs that come nearest to the image errors."),
    Item("groups[].nearest[].model", "text", "Name of the lens model."),
    Item("groups[].nearest[].parameters", "object", "Its parameters, in the units of block.toml."),
    Item("groups[].nearest[].parameters.*", "number", "Value of a parameter."),
    Item("groups[].nearest[].remaining_rms_um", "number", "Root mean square error that the model leaves.", "µm"),
    Item("groups[].nearest[].remaining_max_um", "number", "Largest error that the model leaves.", "µm"),
    Item("photographs[]", "object", "One entry a photograph that was corrected."),
    Item("photographs[].file", "text", "File of the photograph."),
    Item("photographs[].written", "text", "File that was written."),
    Item("photographs[].group", "text", "Its group."),
    Item("photographs[].left_out[]", "text", "What of the file could not be kept."),
    Item("photographs[].seconds", "number", "Time it took.", "s"),
    Item(
        "photographs[].relief_rms_px",
        "number?",
        "Of a rolling shutter: what the relief of the ground over a plane leaves, RMS over the tie points.",
        "px",
        optional=True,
    ),
    Item("files[]", "text", "All files written."),
    *ARGUMENTS,
)
CORRECTION = (
    Item("camera", "text", "Camera."),
    Item("group", "text", "Group of photographs."),
    Item("tile", "whole", "Part of the format without seams inside; interpolate within one tile only."),
    Item("column", "number", "Column of the node.", "px"),
    Item("row", "number", "Row of the node.", "px"),
    *of_axes("{}", "number", "{} of the node, from the image centre.", "mm", ("x", "y")),
    *of_axes("d{}", "number", "Image error in {}: measured minus ideal.", "mm", ("x", "y")),
    *of_axes("s{}", "number", "Standard deviation of the image error in {}.", "mm", ("x", "y")),
)
KINDS = Item("kind", "text", "Kind of unknowns, such as object points.")
DIFFERENCES = (
    KINDS,
    Item("count", "whole", "Number of unknowns compared."),
    Item("max", "number?", "Largest difference, in standard deviations."),
    Item("rms", "number?", "Root mean square difference, in standard deviations."),
    Item("worst", "text", "The unknown that differs most."),
)
CROSSCHECK_JSON = (
    *HEAD,
    BLOCK,
    Item(
        "verdict",
        "text",
        "Whether the other programs find the same.",
        values={
            "agrees": "within the limits",
            "differs": "beyond them",
            "parameters not checked": "within the limits, but no program has the parameters of the block",
            "not checked": "none could adjust the block",
        },
    ),
    Item("parameters_not_checked[]", "text", "Parameters that no program has checked, such as collocation."),
    Item("message", "text", "The verdict in a line."),
    Item("limits", "object", "What differences may be."),
    Item("limits.sigma", "number", "Of an unknown, in its standard deviations."),
    Item("limits.vtpv", "number", "Of vᵀPv, of itself."),
    Item("limits.covariance", "number", "Of standard deviations, of themselves."),
    Item("limits.patterns", "number", "Of the pattern of a parameter, of its largest value."),
    Item("checks[]", "object", "One entry a program."),
    Item(
        "checks[].peer",
        "text",
        "The program.",
        values={"pycolmap": "", "independent model": "a model of its own in Ceres"},
    ),
    Item("checks[].question", "text", "What is compared."),
    Item(
        "checks[].status",
        "text",
        "Its outcome.",
        values={"agrees": "", "differs": "", "not converged": "", "not available": ""},
    ),
    Item("checks[].reason", "text", "Why it differs, or is not available."),
    Item("checks[].solver", "text", "Its solver."),
    Item("checks[].iterations", "whole", "Its iterations."),
    Item("checks[].seconds", "number", "Time it took.", "s"),
    Item("checks[].observations", "whole", "Observations it had."),
    Item("checks[].unknowns", "whole", "Unknowns it had."),
    Item("checks[].vtpv", "number?", "vᵀPv of aerotri."),
    Item("checks[].vtpv_peer", "number?", "vᵀPv of the other program."),
    Item("checks[].vtpv_difference", "number?", "Their difference, of itself."),
    Item("checks[].differences[]", "object", "One entry a kind of unknowns."),
    *(Item(f"checks[].differences[].{one.name}", one.kind, one.text) for one in DIFFERENCES),
    Item("checks[].covariance", "object?", "Comparison of the standard deviations; null where there is none."),
    Item("checks[].covariance.photographs", "whole", "Photographs compared."),
    Item("checks[].covariance.sigma", "number?", "Largest difference of a standard deviation, of itself."),
    Item("checks[].covariance.correlation", "number?", "Largest difference of a correlation."),
    Item("checks[].covariance.worst", "text", "The photograph that differs most."),
    Item("checks[].patterns", "object?", "Formulas compared directly; null where they are not."),
    Item("checks[].patterns.count", "whole", "Parameters compared, and the collinearity equations."),
    Item("checks[].patterns.max", "number?", "Largest difference of a pattern, of its largest value."),
    Item("checks[].patterns.worst", "text", "The parameter that differs most."),
    Item("checks[].notes[]", "text", "What to bear in mind."),
)


def _raster(name: str, place: str, text: str, when: str = "") -> DescribedFile:
    return DescribedFile(name, place, "raster", text, when=when)


def image_error_files() -> tuple[DescribedFile, ...]:
    """The files of deform, demcor, imgeo and crosscheck."""
    block = "of a whole block"
    return (
        DescribedFile("deform.json", DEFORM, "json", "Extremes and RMS of the model deformation.", DEFORM_JSON),
        *(_raster(f"d{axis}.tif", DEFORM, f"Error of {axis} at every node, wrong minus true, m.") for axis in "XYZ"),
        *(_raster(f"sigma_d{axis}.tif", DEFORM, f"Standard deviation of the error of {axis}, m.") for axis in "XYZ"),
        _raster("model.tif", DEFORM, "Number of the model that every node belongs to.", block),
        DescribedFile("models.csv", DEFORM, "table", "The models by their numbers.", MODELS, block),
        DescribedFile("seams.csv", DEFORM, "table", "Steps of dZ between neighbouring models.", SEAMS, block),
        DescribedFile("plots", DEFORM, "folder", "Contours and profiles, PNG and SVG.", when="unless --no-plots"),
        _raster("NAME.tif", DEMCOR, "The corrected DEM, under the name of --out."),
        _raster("NAME_dZ.tif", DEMCOR, "The correction that was taken off, m."),
        _raster("NAME_sigma_dZ.tif", DEMCOR, "Standard deviation of the correction, m, on coarser cells."),
        DescribedFile("NAME_demcor.json", DEMCOR, "json", "What was corrected, and the steps at seams.", DEMCOR_JSON),
        DescribedFile("imgeo.json", IMGEO, "json", "Image errors by group, and the files written.", IMGEO_JSON),
        _raster("PHOTOGRAPH.tif", IMGEO, "The photographs without systematic image errors."),
        DescribedFile("correction.csv", IMGEO, "table", "Image errors on a grid, with σ.", CORRECTION),
        _raster("correction.tif", IMGEO, "Image errors dx and dy as a raster, mm; one for each group."),
        DescribedFile("camera.toml", IMGEO, "text", "The ideal camera as block.toml has it."),
        DescribedFile("cameras.txt", IMGEO, "text", "For COLMAP: the lens model nearest to the image errors."),
        DescribedFile("ideal_cameras.txt", IMGEO, "text", "For COLMAP: the ideal camera."),
        DescribedFile("crosscheck.json", CROSSCHECK, "json", "What other programs find.", CROSSCHECK_JSON),
        DescribedFile(
            "crosscheck.csv",
            CROSSCHECK,
            "table",
            "Differences by kind of unknowns.",
            (Item("peer", "text", "The program."), *DIFFERENCES),
        ),
        DescribedFile("plots", CROSSCHECK, "folder", "Differences of every program, PNG and SVG."),
        DescribedFile("report.html", CROSSCHECK, "page", "The report of the adjustment with the comparison."),
    )
