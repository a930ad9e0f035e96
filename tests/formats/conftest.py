"""Where the real data lie, and a small block as text that tests change."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"

BLOCK_TOML = """\
name = "small"
image_unit = "mm"

[camera.cam]
size_px = [10000, 8000]
pixel_um = 10.0
focal_length_mm = 100.0

[stochastic]
image_sigma_um = 2.0
default_control_sigma_m = [0.1, 0.2, 0.3]

[adjustment]
robust = "off"
"""
IMAGES = """\
image,camera,strip,day,X0,Y0,Z0,omega,phi,kappa
a,cam,1,mon,1,2,1000,0,0,90
b,cam,1,tue,101,2,1000,,,
"""
IMAGE_POINTS = """\
image,point,x,y
a,p1,10.5,-3.25
a,p2,1,2
b,p1,-10.5,3.25
b,p2,-3,-4
"""
CONTROL = """\
point,X,Y,Z,sX,sY,sZ,role
p1,500000.5,5700000.25,100,0.02,0.02,0.04,control
p9,,,120,,,,check
"""
GNSS = """\
image,X,Y,Z,sX,sY,sZ,omega,phi,kappa,s_omega,s_phi,s_kappa,time
a,1.5,2.5,1001,0.05,0.05,0.1,0.1,0.2,90,0.01,0.01,0.02,17.5
b,101.5,2.5,1001,0.05,0.05,0.1,,,,,,,18.5
"""
SMALL = {
    "block.toml": BLOCK_TOML,
    "images.csv": IMAGES,
    "image_points.csv": IMAGE_POINTS,
    "control.csv": CONTROL,
    "gnss_ins.csv": GNSS,
}


@pytest.fixture(scope="session")
def shared_data() -> Callable[[str], Path]:
    """The folder of a real data set; the test is skipped where it is missing."""

    def folder(name: str) -> Path:
        path = DATA / name
        if not path.exists():
            pytest.skip(f"real data '{name}' is not at ../shared/data")
        return path

    return folder


@pytest.fixture
def small_block(tmp_path) -> Callable[..., Path]:
    """Writes the small block; files are replaced or (None) left out by keyword-like pairs of name and content."""

    def write(changes: dict[str, str | bytes | None] | None = None) -> Path:
        folder = tmp_path / "small"
        folder.mkdir(exist_ok=True)
        for name, content in (SMALL | (changes or {})).items():
            if content is None:
                continue
            data = content if isinstance(content, bytes) else content.encode("utf-8")
            (folder / name).write_bytes(data)
        return folder

    return write
