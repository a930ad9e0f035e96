"""The notebooks of the documentation run from their first cell to the last, and what their text says is true.

Hidden cells of each notebook assert what its sentences say of the numbers.
"""

from __future__ import annotations

from pathlib import Path

import pytest

NOTEBOOKS = Path(__file__).parents[2] / "docs" / "notebooks"
PAGES = sorted(path for path in NOTEBOOKS.glob("*.md") if path.stem != "index")


def read(path: Path):
    """The notebook of a page of text, as the documentation reads it."""
    reading = pytest.importorskip("myst_nb.core.read")
    return reading.read_myst_markdown_notebook(path.read_text(encoding="utf-8"), path=str(path))


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_notebook_runs(page, tmp_path):
    """In an empty folder, without a warning; at least one picture, and at least one cell that checks the text."""
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    notebook = read(page)
    resources = {"metadata": {"path": str(tmp_path)}}
    nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3", resources=resources).execute()
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    outputs = [output for cell in cells for output in cell.outputs]
    assert [one.text for one in outputs if one.output_type == "stream" and one.name == "stderr"] == []
    assert any("image/png" in one.get("data", {}) for one in outputs)
    hidden = [cell for cell in cells if "remove-cell" in cell.metadata.get("tags", [])]
    assert any("assert " in cell.source for cell in hidden)


def test_index_lists_every_notebook():
    text = (NOTEBOOKS / "index.md").read_text(encoding="utf-8")
    for page in PAGES:
        assert f"]({page.name})" in text
        assert f"\n{page.stem}\n" in text
