"""What JSON files say of the arguments they were computed with: all of them, but for what names input and place."""

from __future__ import annotations

import inspect

import numpy as np

import aerotri

PLACES = {"out", "project", "progress", "executor", "scratch", "overwrite"}


def stated(function, settings, *inputs: str) -> set[str]:
    """Names of the arguments that were given; all others stand there as default ones."""
    names = {one["key"] for one in settings}
    assert inspect.signature(function).parameters.keys() - PLACES == names | set(inputs)
    return {one["key"] for one in settings if one["origin"] == "given"}


def test_of_surfaces_and_clouds():
    x = np.linspace(0.0, 3.0, 50)
    hills = aerotri.Surface.of_array(np.sin(x)[:, None] + np.cos(x), left=0.0, top=100.0, cell=2.0)
    found = aerotri.compare(hills, hills, align="shift")
    assert stated(aerotri.compare, found.summary["settings"], "test", "control") == {"align"}
    rng = np.random.default_rng(1)
    cloud = np.column_stack([rng.uniform(0, 10, (4000, 2)), rng.normal(0, 0.02, 4000)])
    moved = aerotri.cloud_change(cloud, cloud + [0.0, 0.0, 0.3], cylinder=1.0)
    inputs = ("first", "second", "first_adjustment", "second_adjustment")
    assert stated(aerotri.cloud_change, moved.summary["settings"], *inputs) == {"cylinder"}


def test_of_what_begins_with_a_result(result, tmp_path):
    found = aerotri.accuracy(result, class_vertical=0.3)
    assert stated(aerotri.accuracy, found.content["settings"], "result") == {"class_vertical"}
    model = aerotri.deform(result, end_lap=0.75, spacing=20.0)
    assert stated(aerotri.deform, model.summary["settings"], "result") == {"end_lap", "spacing"}
    ideal = aerotri.ideal_photographs(result, out=tmp_path / "ideal")
    assert stated(aerotri.ideal_photographs, ideal.summary["settings"], "result", "photographs") == set()
    halves = aerotri.halves(result, ["photographs"])
    assert stated(aerotri.halves, halves.content["settings"], "result") == {"divisions"}
    x, y = (result.images[name][1:3].mean() for name in ("X0", "Y0"))
    flat = aerotri.Surface.of_array(np.full((30, 30), 100.0), left=x - 15.0, top=y + 15.0, cell=1.0)
    dem = aerotri.correct_dem(flat, result, pair=tuple(result.images["image"][1:3]))
    assert stated(aerotri.correct_dem, dem.summary["settings"], "dem", "result") == {"pair"}
    assert next(one["value"] for one in dem.summary["settings"] if one["key"] == "pair")[0] == result.images["image"][1]
