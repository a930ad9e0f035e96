"""What does not fit into memory is refused before it is taken."""

from __future__ import annotations

import numpy as np
import pytest

from aerotri import memory
from aerotri.conventions import InputError
from aerotri.memory import fitting, refuse_beyond_memory
from aerotri.rasters.grids import Grid, RasterReader, write_raster
from aerotri.simulation import parse_spec, simulate
from aerotri.terrain import compare as comparing
from aerotri.terrain.compare import FileHeights, RasterHeights, compare
from aerotri.terrain.pickets import Area, grid_nodes
from aerotri.terrain.surface import grid_over
from small_blocks import small_spec

HUGE = 10**9


@pytest.fixture
def four_gib(monkeypatch):
    monkeypatch.setattr(memory, "available_bytes", lambda: 4 << 30)


def test_what_is_free_is_known():
    assert memory.available_bytes() > 1 << 20
    assert memory._of_container(("/no/such/file", "/no/such/file")) is None


def test_limits_of_container_and_process_count(monkeypatch, tmp_path):
    (tmp_path / "limit").write_text("1000\n")
    (tmp_path / "used").write_text("400\n")
    names = (str(tmp_path / "limit"), str(tmp_path / "used"))
    assert memory._of_container(names) == 600
    monkeypatch.setattr(memory, "NAMES_OF_LIMITS", (names,))
    assert memory.available_bytes() == 600


def test_refusal_says_what_would_fit(four_gib):
    refuse_beyond_memory(1 << 30, "things", "take fewer")
    said = r"things need 8\.0 GiB of memory; 3\.2 GiB may be used, 80 % of what is free — take 0\.4 of them"
    with pytest.raises(InputError, match=said):
        refuse_beyond_memory(8 << 30, "things", "take {share} of them")
    with pytest.raises(InputError, match="far more than a machine has"):
        refuse_beyond_memory(float("inf"), "things", "")
    assert fitting(1 << 20) == pytest.approx(0.8 * 4096)


@pytest.mark.parametrize(
    ("needed", "there", "words"),
    [
        (6.0 * 2**30, 5.6 * 2**30, ("6.0 GiB", "5.6 GiB")),
        (6.01 * 2**30, 6.0 * 2**30, ("6.1 GiB", "6.0 GiB")),
        (3.0 * 2**30 + 1, 3.0 * 2**30, ("3.1 GiB", "3.0 GiB")),
        (30.2 * 2**20, 30.1 * 2**20, ("30.2 MiB", "30.1 MiB")),
        (1e30, 2**31, ("far more than a machine has", "2.0 GiB")),
    ],
)
def test_two_sizes_never_contradict_each_other(needed, there, words):
    """6.01 are more than 6.00, and are not both written as 6.0."""
    assert memory.two_sizes(needed, there) == words


@pytest.mark.parametrize(
    ("table", "changes", "said"),
    [
        ("tie_points", {"per_image": 1e9}, "image points need .* lower 'tie_points.per_image' to"),
        ("tie_points", {"pattern": [HUGE, HUGE], "distribution": "nodes"}, "lower 'tie_points.pattern'"),
        ("flight", {"strips": HUGE}, "photographs need"),
        ("flight", {"strips": HUGE, "images_per_strip": HUGE}, "photographs need far more than a machine has"),
        ("flight", {"cross_strips": [{"images": HUGE}]}, "photographs need"),
        ("flight", {"days": HUGE}, "'flight.days' = 1000000000 is more than the photographs"),
        ("control", {"check_points": HUGE}, "control and check points need"),
        ("control", {"distance_bases": 1e-6}, "raise 'control.distance_bases'"),
        ("towers", {"height_m": 10.0, "per_image": HUGE}, "lower 'towers.per_image'"),
    ],
)
def test_simulations_that_cannot_fit(four_gib, table, changes, said):
    spec = small_spec()
    with pytest.raises(InputError, match=said):
        simulate(parse_spec({**spec, table: {**spec.get(table, {}), **changes}}), 1)


def test_pickets_and_cells_that_cannot_fit(four_gib):
    with pytest.raises(InputError, match=r"pickets every 1e-09 m need .* an --interval of at least 0.66 m"):
        grid_nodes(Area(np.zeros(2), np.full(2, 1e3)), 1e-9)
    with pytest.raises(InputError, match=r"cells of 1e-06 m need .* --cell of at least"):
        grid_over(np.array([[0.0, 0.0], [1e3, 1e3]]), 1e-6)


def test_a_raster_read_part_by_part_gives_the_same(tmp_path, monkeypatch):
    """Holes, edges and parts: differences as of rasters that are held."""
    monkeypatch.setattr(comparing, "PART_CELLS", 900)
    rng = np.random.default_rng(3)
    surfaces = []
    for k, (rows, columns) in enumerate(((90, 130), (110, 100))):
        grid = Grid(rows, columns, 1000.0 - 3.0 * k, 5000.0 + 2.0 * k, 1.0, 1.0)
        z = rng.normal(size=(rows, columns)).astype(np.float32)
        z[30:50, 20:70] = np.nan
        write_raster(tmp_path / f"{k}.tif", z, grid, None, "Z, m")
        surfaces.append((grid, z.astype(float)))
    target, told = Grid(60, 80, 1001.0, 4999.0, 1.5, 1.5), []
    held = compare(*(RasterHeights(grid, z) for grid, z in surfaces), target)
    with RasterReader(tmp_path / "0.tif") as one, RasterReader(tmp_path / "1.tif") as other:
        read = compare(FileHeights(one), FileHeights(other), target, report=lambda done, of: told.append((done, of)))
        with pytest.raises(InputError, match="too large to be aligned"):
            compare(FileHeights(one), FileHeights(other), target, alignment="shift")
    np.testing.assert_allclose(read.difference, held.difference, atol=1e-12)
    assert np.isfinite(held.difference).sum() > 2000
    assert read.coverage == held.coverage
    assert told[-1] == (12, 12)


def test_sections_that_are_too_many(tmp_path):
    from aerotri.volume.bases import level
    from aerotri.volume.boundary import boundary_of_grid
    from aerotri.volume.sections import cross_sections

    grid = Grid(20, 20, 0.0, 20.0, 1.0, 1.0)
    write_raster(tmp_path / "z.tif", np.ones((20, 20)), grid, None, "Z, m")
    with (
        RasterReader(tmp_path / "z.tif") as reader,
        pytest.raises(InputError, match=r"would be 19000000, 1000000 at most .* of at least 0.000019 m"),
    ):
        cross_sections(reader, level(0.0), boundary_of_grid(grid), 1e-6)


def test_a_design_of_too_many_models():
    from aerotri.commands.predict import run_predict_volume
    from aerotri.simulation.designs import VolumeDesign

    with pytest.raises(InputError, match=r"the area has .* models, 100000 at most"):
        run_predict_volume(VolumeDesign(1.0, 1e12, 1e12, 100.0), False, 1, True)
