"""A block of scanned film from its fiducial marks to the report: interior orientation, adjustment, residuals shown."""

from dataclasses import replace

import numpy as np

from aerotri.formats.block.folder import read_block, write_block
from aerotri.pipeline import adjust
from aerotri.report.tables import adjustment as tables
from small_blocks import small_block

MARKS = {"F1": (-45.0, -28.0), "F2": (45.0, -28.0), "F3": (45.0, 28.0), "F4": (-45.0, 28.0)}


def test_scanned_film_end_to_end(tmp_path):
    """Scans turned, shifted and stretched against the camera: the adjustment is that of the mm coordinates."""
    block, _ = small_block(41)
    plain = adjust(block)
    write_block(block, tmp_path / "mm")
    folder = tmp_path / "film"
    (tmp_path / "mm").rename(folder)
    rng = np.random.default_rng(2)
    rays, fiducials = ["image,point,x,y,sx,sy"], ["image,fiducial,column,row"]
    pixel = block.cameras[0].pixel_mm
    for number, name in enumerate(block.images.names):
        turn = rng.normal(0, 0.002)
        matrix = np.array([[1.0003 * np.cos(turn), -np.sin(turn)], [np.sin(turn), 0.9998 * np.cos(turn)]]) / pixel

        shift = rng.uniform(50, 90, 2)

        def scanned(xy, matrix=matrix, shift=shift):
            column_row = xy @ matrix.T * [1.0, -1.0] + [5750.0, 3750.0] + shift
            return column_row

        for mark, xy in MARKS.items():
            column, row = scanned(np.array(xy)) + rng.normal(0, 0.05, 2)
            fiducials.append(f"{name},{mark},{column:.4f},{row:.4f}")
        own = np.flatnonzero(block.image_points.image == number)
        for k, (column, row) in zip(own, scanned(block.image_points.xy[own]), strict=True):
            rays.append(f"{name},{block.points[block.image_points.point[k]]},{column:.5f},{row:.5f},0.22,0.22")
    (folder / "image_points.csv").write_text("\n".join(rays) + "\n")
    (folder / "fiducials.csv").write_text("\n".join(fiducials) + "\n")
    text = (folder / "block.toml").read_text().replace('image_unit = "mm"', 'image_unit = "px"')
    marks = "\n".join(f"{m} = [{x}, {y}]" for m, (x, y) in MARKS.items())
    text = text.replace('model = "ultracam_d"', 'model = "ultracam_d"\ninterior_orientation = "affine"', 1)
    text += f"\n[camera.ucd.fiducials]\n{marks}\n"
    (folder / "block.toml").write_text(text)
    film = read_block(folder)
    # marks measured to 0.05 px leave the image points within a fraction of that
    order = {
        (i, p): k
        for k, (i, p) in enumerate(zip(block.image_points.image, block.points[block.image_points.point], strict=True))
    }
    rows = [order[i, p] for i, p in zip(film.image_points.image, film.points[film.image_points.point], strict=True)]
    np.testing.assert_allclose(film.image_points.xy, block.image_points.xy[rows], atol=0.2 * pixel)
    result = adjust(film)
    assert result.outcome.status == "converged"
    assert abs(result.outcome.sigma0_um / plain.outcome.sigma0_um - 1.0) < 0.1
    table = tables.film(result)
    assert len(table.rows) == len(block.images)
    assert table.rows[0][1:4] == ("affine", 4, 2)
    sigma = np.array([row[4] for row in table.rows])
    assert 0.2 < np.median(sigma) / (0.05 * 1e3 * pixel) < 2.0
    assert tables.film(plain).rows == ()
    assert replace(film).interior_fits is film.interior_fits
