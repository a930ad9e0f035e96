"""Names with blanks in lists whose entries blanks separate."""

import numpy as np
import pytest

from aerotri.formats.foreign.odm import is_odm_gcp, is_odm_geo, read_odm_gcp, read_odm_geo

GCP = {
    "quotes": '1 2 3 4 5 "flight 1/my photo.JPG" "point 1" extra\n',
    "tabs": "1\t2\t3\t4\t5\tflight 1/my photo.JPG\tpoint 1\textra\n",
}


@pytest.mark.parametrize("form", GCP)
def test_gcp_list(form, tmp_path):
    path = tmp_path / "gcp_list.txt"
    path.write_text("EPSG:32632\n" + GCP[form])
    assert is_odm_gcp(path)
    found = read_odm_gcp(path)
    assert found.rays is not None
    assert found.rays.images.tolist() == ["flight 1/my photo.JPG"]
    assert found.points.tolist() == ["point 1"]
    np.testing.assert_array_equal(found.rays.xy, [[4.5, 5.5]])


def test_image_ends_where_its_file_does(tmp_path):
    """As programs write it that do not think of blanks: the image's name is as long as its ending says."""
    path = tmp_path / "gcp_list.txt"
    path.write_text("EPSG:32632\n1 2 3 4 5 my photo.JPG P1 extra\n1 2 3 4 5 other P1\n")
    found = read_odm_gcp(path)
    assert found.rays is not None
    assert found.rays.images.tolist() == ["my photo.JPG", "other"]
    assert found.points.tolist() == ["P1"]


@pytest.mark.parametrize("name", ['"my photo.JPG"', "my photo.JPG"])
def test_geo(name, tmp_path):
    path = tmp_path / "geo.txt"
    path.write_text(f"EPSG:32632\n{name} 500000 5300000 100\nother 500100 5300000 100\n")
    assert is_odm_geo(path)
    found = read_odm_geo(path)
    assert found.images.tolist() == ["my photo.JPG", "other"]
    np.testing.assert_array_equal(found.xyz[:, 0], [500000.0, 500100.0])
