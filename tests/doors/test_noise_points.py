"""Points that a cloud marks as noise, or withholds, are no ground."""

from __future__ import annotations

import json
from pathlib import Path

import pytest


def _compared(run, cloud):
    done = run(f"compare {cloud}.laz s.tif --out {cloud} --no-plots")
    assert done.exit_code == 0
    return json.loads(Path(f"{cloud}/compare.json").read_text(encoding="utf-8"))["difference_m"], done.output


@pytest.mark.parametrize(("cloud", "count"), [("noise", 40), ("near", 400)])
def test_marked_points_are_left_out_and_counted(cloud, count, door, run):
    door("noise_points")
    (clean, silent), (found, said) = _compared(run, "clean"), _compared(run, cloud)
    for name in ("bias", "rmse"):
        assert found[name] == pytest.approx(clean[name], abs=5e-3)
    assert f"{count} of {4000 + count} points are marked as noise" in " ".join(said.split())
    assert "noise (class" not in silent


def test_change_of_clouds_leaves_them_out_too(door, run):
    door("noise_points")
    words = "--cylinder 1.5 --normal 3 --spacing 2 --no-plots"
    for other in ("near", "noise"):
        assert run(f"change clean.laz {other}.laz --out {other} {words}").exit_code == 0
        found = json.loads(Path(f"{other}/cloud_change.json").read_text(encoding="utf-8"))
        assert any("points are marked as noise" in text for text in found["warnings"])
        assert found["points_second"] == 4000
        assert found["distance_m"]["largest"] < 0.1
