"""A principal distance that photographs alone make implausible is held, and nothing else."""

from dataclasses import replace

from aerotri.observations import Prior
from aerotri.tie_points.orientation import _plausible
from small_blocks import small_block


def test_principal_point_and_lens_stay_free():
    """26 % off: the principal distance is held as stated; principal point and lens are not."""
    interior = {"focal_length_mm": Prior(3.61), "x0_mm": Prior(0.0), "y0_mm": Prior(0.0)}
    lens = {name: Prior(0.0) for name in ("k1", "k2", "p1", "p2", "k3")}
    stated = replace(small_block(1)[0].cameras[0], interior=interior, lens=lens)
    found = replace(stated, interior=interior | {"focal_length_mm": Prior(4.54)})
    cameras, said = _plausible((stated,), (found,))
    kinds = {name: prior.kind for name, prior in {**cameras[0].interior, **cameras[0].lens}.items()}
    assert cameras[0].focal_length_mm == 3.61
    assert [name for name, kind in kinds.items() if kind != "free"] == ["focal_length_mm"]
    assert len(said) == 1
    assert "held at 3.61 mm" in said[0]
    near = replace(stated, interior=interior | {"focal_length_mm": Prior(3.7)})
    assert _plausible((stated,), (near,)) == ((stated,), ())
