"""The lines of the first steps as a notebook runs them, and what each of its cells shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rendered_photographs import Lists, fly, write_gcp_list

pytestmark = pytest.mark.slow
HERE = Path(__file__).parent
BLOCKS = HERE.parents[1] / "blocks"


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """The outputs of every cell by its tag; a kernel of its own, in a folder with the files that the text names."""
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    folder = tmp_path_factory.mktemp("notebook")
    (folder / "blocks").symlink_to(BLOCKS, target_is_directory=True)
    flown = fly(folder / "photographs")
    write_gcp_list(flown, folder / "gcp_list.txt", Lists({}))
    corners = np.median(flown.block.control.xyz[:, :2], axis=0) + np.array([[-12, -10], [12, -9], [10, 11], [-11, 10]])
    ring = ", ".join("{:.3f} {:.3f}".format(*corner) for corner in (*corners, corners[0]))
    (folder / "boundary.wkt").write_text(f"POLYGON (({ring}))", encoding="utf-8")
    notebook = nbformat.read(HERE / "first_steps.ipynb", as_version=4)
    nbformat.validate(notebook)
    resources = {"metadata": {"path": str(folder)}}
    client = nbclient.NotebookClient(notebook, timeout=900, kernel_name="python3", resources=resources)
    client.execute()
    cells = {cell.metadata["tags"][0]: cell.outputs for cell in notebook.cells if cell.cell_type == "code"}
    return cells, folder


def value(outputs, kind="text/plain"):
    """What the last line of a cell shows."""
    results = [output["data"] for output in outputs if output["output_type"] == "execute_result"]
    assert len(results) == 1, outputs
    return results[0][kind]


def test_nothing_is_printed(shown):
    """Results are shown, not printed; nothing fails but the cell that is wrong."""
    for tag, outputs in shown[0].items():
        for output in outputs:
            assert output["output_type"] != "stream", (tag, output)
            assert (output["output_type"] == "error") == (tag == "error"), (tag, output)


def test_block_and_result_show_what_they_are(shown):
    cells, _ = shown
    assert "<th>photographs</th>" in value(cells["block"], "text/html")
    assert "accepted" in value(cells["adjust"], "text/html")
    sigma0, verdict, *_ = eval(value(cells["numbers"]))
    assert 0.9 < sigma0 < 1.3
    assert verdict == "accepted"
    assert "<td>bluh.1</td>" in value(cells["table"], "text/html")
    assert eval(value(cells["arrow"]))[:4] == ["point", "X", "Y", "Z"]
    names = value(cells["covariance"], "text/html")
    assert "T000457:Z" in names
    assert "1_008:X0" in names


def test_progress_is_a_line_that_goes_away(shown):
    """Of the many states of the bar an empty one stays."""
    lines = [output["data"]["text/plain"] for output in shown[0]["adjust"] if output["output_type"] == "display_data"]
    assert lines == [""]


def test_plots_are_pictures(shown):
    for tag in ("plot", "deform"):
        assert value(shown[0][tag], "image/png").startswith("iVBOR")


def test_a_result_comes_back_from_its_folder(shown):
    cells, folder = shown
    assert float(value(cells["save"])) == pytest.approx(eval(value(cells["numbers"]))[0], rel=1e-9)
    assert (folder / "out" / "adjustment.json").is_file()
    assert 0.1 < float(value(cells["heights"])) < 10.0


def test_photographs_become_a_volume(shown):
    """In one line and step by step the same surface, and the same volume to what a cell of the raster holds."""
    cells, folder = shown
    page = value(cells["run"], "text/html")
    assert page.count("<td>done</td>") == 7
    verdict, _, place, measured = eval(value(cells["verdict"]))
    assert (verdict, place, measured) == ("accepted", "photographs_project", True)
    assert (folder / place / "report.html").is_file()
    assert "pickets accepted" in value(cells["surface"], "text/html")
    net, of_project, sigma = eval(value(cells["same"]))
    assert net == pytest.approx(of_project, abs=0.01 * sigma)
    assert "m³" in value(cells["volume"], "text/html")


def test_an_error_says_what_to_do(shown):
    (error,) = shown[0]["error"]
    assert error["ename"] == "InputError"
    assert "unknown parameter family" in error["evalue"]
