"""`aerotri predict volume` and `predict attitude`."""

from __future__ import annotations

import json

import pytest

from aerotri.commands.predict import AttitudeDesign, run_predict_attitude, run_predict_volume
from aerotri.conventions import InputError
from aerotri.simulation.designs import VolumeDesign


def test_volume_by_theory_and_by_a_simulated_strip(capsys):
    """The bundle adjustment of the same design is near the adjustment of the strip as a whole."""
    run_predict_volume(VolumeDesign(1500.0, 7200.0, 1800.0, 3600.0), True, 1, True)
    content = json.loads(capsys.readouterr().out)
    assert (content["models_between_control"], content["models_per_strip"], content["strips"]) == (4, 8, 1)
    spans, whole, free, simulated = (p["sigma_mean_height_m"] for p in content["predictions"])
    assert whole < spans < free
    assert simulated == pytest.approx(whole, rel=0.35)
    assert content["predictions"][0]["sigma_volume_m3"] == pytest.approx(spans * 7200.0 * 1800.0)


def test_attitude(capsys):
    design = AttitudeDesign(1500.0, 900.0, 153.0, (400.0, 400.0), (100.0, 50.0), 5.0, 1.0)
    run_predict_attitude(design, True)
    content = json.loads(capsys.readouterr().out)
    assert content["tolerance_m3"] == pytest.approx(8000.0)
    # ∂V of one φ is about area·h²/B: a tolerance of 5 cm of mean height over two photographs
    expected = 0.05 / (2.0**0.5 * (1500.0**2 + 450.0**2) / 900.0) * 206265.0
    assert content["angles"]["phi"]["independent_arcsec"] == pytest.approx(expected, rel=0.05)
    assert content["angles"]["phi"]["independent_arcsec"] < content["angles"]["kappa"]["independent_arcsec"]


def test_sizes_have_to_be_positive():
    with pytest.raises(InputError, match="positive"):
        run_predict_volume(VolumeDesign(1500.0, 0.0, 1800.0, 3600.0), False, 1, False)
