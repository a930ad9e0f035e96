"""Tools are built on the public package alone; a few measure its inside, and say so."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import aerotri
from places import PROJECT

TOOLS = PROJECT / "tools"
INSIDE = {
    "benchmark/adjusting/factors.py": "times one factorisation of the normal equations beside other libraries",
    "benchmark/adjusting/ours.py": "times assembly, factorisation, iterations and cofactors one by one",
    "benchmark/adjusting/peers.py": "gives other solvers the equations of the independent model",
    "benchmark/benchmark_first_run.py": "writes down what is compiled while a command runs, and the list of kernels",
    "benchmark/benchmark_imgeo.py": "times the resampling kernel beside cv2.remap",
    "benchmark/benchmark_dense.py": "times semi-global matching alone on the same epipolar images",
    "benchmark/benchmark_memory.py": "runs the commands within processes whose memory is read",
    "benchmark/benchmark_pickets.py": "times the search kernel beside matchTemplate",
    "benchmark/benchmark_reading_others.py": "times the readers of COLMAP and OpenSfM without what is added to them",
    "benchmark/benchmark_rigs.py": "times parts of an iteration of the same flight with and without a rig",
    "benchmark/benchmark_volume.py": "times the response of a functional and a solution with the factor",
    "prove/defects_proof/looks.py": "looks at pivots, free directions and eigenvalues of the factor",
    "prove/brighton_dense.py": "heights of a joint covariance, by noise and by what parameters leave",
    "prove/camera_left.py": "σ of heights with and without what the parameters leave of a camera's errors",
    "prove/change_clouds.py": "distances of clouds in memory, with adjustments that are simulated",
    "prove/dense_matchers.py": "other semi-global matching in place of the one inside",
    "prove/dense_surface.py": "σ of matching alone, cell by cell, and semi-global matching alone on the same pairs",
    "prove/fuzzing/hostile.py": "damaged files for single readers, and for the commands",
    "prove/fuzzing/readers.py": "damaged files for single readers",
    "prove/league_programs/colmap.py": "gives pycolmap the observations and the datum of an adjustment in its frame",
    "prove/dmc_centre_offset.py": "adds the pattern by height to image points, which no simulation does",
    "prove/kill.py": "kills the commands from within",
    "prove/deviations.py": "the sizes of image errors that it simulates, parameter by parameter",
    "prove/ppk_interpolation.py": "interpolates a trajectory without photographs",
    "prove/model_part.py": "every part of the covariance alone, of clusters of photographs",
    "prove/moving/cases.py": "the strips of a track, as an adjustment finds them",
    "prove/moving/flights.py": "the strips of a track, as an adjustment finds them",
    "prove/metamorphic_photographs.py": "the first orientation in orders that no file gives",
    "prove/ortho_adjustment.py": "the adjustment's part of σ of an orthophoto, where details are displaced",
    "prove/ortho_sigma.py": "σ of an orthophoto by its parts, where details are displaced",
    "prove/parts.py": "lets an adjustment go on until only rounding is left",
    "prove/parts_scale.py": "the fronts that the tree lets expect, beside the memory that is measured",
    "prove/parts_converted.py": "loads the packages that convert uses before it looks at the memory",
    "prove/parts_divided.py": "loads the packages that divide uses before it looks at the memory",
    "prove/parts_plan.py": "the plan of a factor and the cuts of a block, without any numbers",
    "prove/runs_elsewhere.py": "hands runs to the executors of the program",
    "prove/starts.py": "times the start without the adjustment that follows",
    "prove/volume_cut_fill.py": "volumes of both sides and their σ, of pickets at stated places",
    "prove/volume_drawn_boundary.py": "volumes and σ of pickets at stated places, for outlines that move with them",
    "prove/volume_epochs.py": "the adjustment's part of σ alone, of pickets at stated places",
    "prove/volume_measured_base.py": "volumes over a measured base and the parts of their σ, at stated places",
    "prove/volume_proof/simulated.py": "every part of σ alone, of pickets at stated places",
    "prove/volume_spline_base.py": "σ of a base alone",
    "reproduce/paper_003_deformation/even_odd.py": "deformation at single points, by another orientation",
    "reproduce/reproduce_paper_003_dense.py": "what an adjustment brings into a difference of two of its surfaces",
    "reproduce/reproduce_paper_000.py": "the paper's formulas for two photographs, which no command uses",
}
"""Files of tools/ that may import modules within the package, and what they measure there."""
COMMANDS = (
    "benchmark/benchmark_first_run.py", "benchmark/benchmark_memory.py", "prove/fuzzing/hostile.py", "prove/kill.py",
)  # fmt: skip
"""Of these, those that test the commands; the others run them as users do, in a process of their own."""


def tools() -> list[str]:
    return sorted(path.relative_to(TOOLS).as_posix() for path in TOOLS.rglob("*.py"))


def inner_names(tree: ast.AST) -> Iterator[str]:
    """What is used of the package that it does not export."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.startswith("aerotri."))
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "aerotri":
            names = [f"{node.module}.{alias.name}" for alias in node.names]
            yield from (name for name in names if name.removeprefix("aerotri.") not in aerotri.__all__)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "aerotri":
            yield from [] if node.attr in aerotri.__all__ else [f"aerotri.{node.attr}"]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            # code in a text
            yield from (part for part in ("from aerotri.", "import aerotri.") if part in node.value)


@pytest.mark.parametrize("tool", tools())
def test_only_what_the_package_exports(tool):
    found = sorted(set(inner_names(ast.parse((TOOLS / tool).read_text(encoding="utf-8")))))
    if tool in INSIDE:
        assert found, f"{tool} imports nothing from within the package: strike it from the table"
    else:
        assert not found, f"{tool}: the public package lacks this, or the tool belongs into the table: {found}"


@pytest.mark.parametrize("tool", sorted(INSIDE))
def test_a_tool_that_looks_inside_says_so(tool):
    text = ast.get_docstring(ast.parse((TOOLS / tool).read_text(encoding="utf-8"))) or ""
    assert "on purpose" in " ".join(text.split())
    assert "Measures" in text


@pytest.mark.parametrize("tool", tools())
def test_commands_are_run_as_users_do(tool):
    found = [name for name in inner_names(ast.parse((TOOLS / tool).read_text(encoding="utf-8")))
             if name.startswith(("aerotri.cli", "aerotri.commands"))]  # fmt: skip
    assert not found or tool in COMMANDS


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("import aerotri\nfrom aerotri import predict as p\naerotri.adjust(1)", []),
        ("from aerotri.pipeline import adjust", ["aerotri.pipeline.adjust"]),
        ("import aerotri.pipeline", ["aerotri.pipeline"]),
        ("from aerotri import pipeline", ["aerotri.pipeline"]),
        ("import aerotri\naerotri.pipeline.adjust(1)", ["aerotri.pipeline"]),
        ("exec('from aerotri.pipeline import adjust')", ["from aerotri."]),
    ],
)
def test_what_counts_as_inside(code, found):
    assert sorted(inner_names(ast.parse(code))) == found


def test_the_table_names_files_that_are_there():
    assert set(INSIDE) <= set(tools())
    assert all(Path(TOOLS / name).is_file() for name in COMMANDS)
