"""A new block: what is written is read, every key stands in it with what the models say, nothing is replaced."""

from __future__ import annotations

import json
import re
import tomllib
from typing import Any, get_args, get_origin

import pytest
from pydantic import BaseModel

import aerotri
from aerotri import InputError
from aerotri.cli.app import invoke
from aerotri.formats.block.settings import read_block_toml
from aerotri.formats.block.settings_model import BlockModel
from aerotri.formats.block.settings_types import PriorModel, ThreePriorsModel
from aerotri.formats.block.template import EMPTY_TABLES, NewCamera, block_toml_text, write_template
from aerotri.formats.block.unread import TABLES

CAMERA = NewCamera("P1", (8192, 5460), 4.4, 35.0)
IMAGES = "a,P1,1,0,0,100,0,0,0\nb,P1,1,40,0,100,0,0,0\n"
IMAGE_POINTS = "a,T,1,1,0.01,0.01\nb,T,-1,1,0.01,0.01\n"


def keys(model: type[BaseModel], table: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Every key of the models by its path, the camera's name as P1."""
    found = []
    for name, field in model.model_fields.items():
        inner: Any = get_args(field.annotation)[1] if get_origin(field.annotation) is dict else field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel) and inner not in (PriorModel, ThreePriorsModel):
            named = {("camera",): "P1", ("rig",): "my_rig", ("rig", "my_rig", "camera"): "oblique"}.get((*table, name))
            found += keys(inner, (*table, name) if named is None else (*table, name, named))
        else:
            found.append((*table, name))
    return found


def uncommented(text: str) -> str:
    """The text with the # of every key taken away."""
    return re.sub(r"^#(\w+ = |\[)", r"\1", text, flags=re.MULTILINE)


def at(content: Any, path: tuple[str, ...]) -> Any:
    for part in path:
        content = content[part]
    return content


def test_every_key_stands_in_it():
    """With the description of its model directly above, its unit and its default; no key that there is not."""
    text = block_toml_text(CAMERA)
    content = tomllib.loads(uncommented(text))
    said = " ".join(re.sub(r"^# ", "", text, flags=re.MULTILINE).split())
    for path in keys(BlockModel):
        assert at(content, path) is not None, path
    assert len(re.findall(r"^#?\w+ = ", text, re.MULTILINE)) == len(keys(BlockModel))
    for path, words in (
        (("camera", "P1", "pixel_um"), "[unit µm; required]"),
        (("gnss", "shift"), '[one of off, block, strip; default "off"]'),
        (("image_unit",), '[one of mm, um, px; default "mm"]'),
        (("stochastic", "image_sigma_um"), "[unit µm] Set here to half a pixel, a usual value."),
    ):
        field = at_model(path)
        assert f"{' '.join(str(field.description).split())} {words}" in said, path


def at_model(path: tuple[str, ...]) -> Any:
    model: Any = BlockModel
    for part in path[:-1]:
        if part != "P1":
            annotation = model.model_fields[part].annotation
            model = get_args(annotation)[1] if get_origin(annotation) is dict else annotation
    return model.model_fields[path[-1]]


def test_what_is_written_is_read_as_the_defaults(tmp_path):
    """The camera, the unit and σ of the image points are in force; with every # away it is accepted too."""
    write_template(tmp_path / "new", CAMERA)
    model = read_block_toml(tmp_path / "new" / "block.toml").model
    camera = {"size_px": [8192, 5460], "pixel_um": 4.4, "focal_length_mm": 35.0}
    own = {"camera": {"P1": camera}, "image_unit": "px", "stochastic": {"image_sigma_um": 2.2}}
    assert model == BlockModel.model_validate(own)
    text = (tmp_path / "new" / "block.toml").read_text(encoding="utf-8")
    (tmp_path / "new" / "block.toml").write_text(uncommented(text), encoding="utf-8")
    everything = read_block_toml(tmp_path / "new" / "block.toml").model
    assert everything.camera["P1"].interior.focal_length_mm == PriorModel()
    assert everything.gnss == model.gnss.model_copy(
        update={"lever_arm_sigma_m": [0.01, 0.01, 0.01], "correlation_time_s": 60.0, "correlated_sigma_m": [0.02, 0.03]}
    )


def test_tables_have_the_columns_of_their_readers(tmp_path):
    """Filled in with two photographs and a point the folder is a block; empty tables count as missing ones."""
    write_template(tmp_path / "new", CAMERA)
    for name, columns in EMPTY_TABLES.items():
        header = (tmp_path / "new" / f"{name}.csv").read_text().strip().split(",")
        assert set(header) == set(columns.known)
        assert TABLES[name] is columns
    for name, rows in (("images", IMAGES), ("image_points", IMAGE_POINTS)):
        path = tmp_path / "new" / f"{name}.csv"
        path.write_text(path.read_text() + rows)
    block = aerotri.read_block(tmp_path / "new")
    assert (block.name, len(block.images), len(block.image_points), len(block.control)) == ("new", 2, 2, 0)
    assert block.gnss_ins is None
    assert aerotri.check(tmp_path / "new").notes == ()


def test_nothing_is_replaced(tmp_path, capsys):
    """A second time it is refused, and so it is where one file stands; other files of the folder stay."""
    folder = tmp_path / "new"
    assert invoke(["init", str(folder), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["files"][0] == "block.toml"
    (folder / "block.toml").write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        invoke(["init", str(folder)])
    assert (folder / "block.toml").read_text() == "mine"
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "control.parquet").write_text("mine")
    with pytest.raises(InputError, match=r"control\.parquet: exists already"):
        write_template(tmp_path / "other")
    assert [path.name for path in (tmp_path / "other").iterdir()] == ["control.parquet"]
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "notes.md").write_text("mine")
    assert invoke(["init", str(tmp_path / "notes")]) == 0
    told = capsys.readouterr().out
    assert "is an example" in told
    assert f"aerotri check {tmp_path / 'notes'}" in told
    assert (tmp_path / "notes" / "notes.md").read_text() == "mine"


def test_names_that_need_quotes(tmp_path):
    write_template(tmp_path / "new", NewCamera("Zenmuse P1 (2)"))
    assert list(read_block_toml(tmp_path / "new" / "block.toml").model.camera) == ["Zenmuse P1 (2)"]


def test_all_that_is_missing_in_a_new_block_is_said_at_once(tmp_path, capsys):
    """The example camera, photographs, image points and control; a camera that was stated is no example."""
    assert invoke(["init", str(tmp_path / "new")]) == 0
    capsys.readouterr()
    assert invoke(["check", str(tmp_path / "new")]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if line.startswith("note: camera 'main' is the example")]
    missing = [line for line in lines if line.startswith("missing: ")]
    for what, line in zip(("no photographs", "no image points", "no control"), missing, strict=True):
        assert what in line
    write_template(tmp_path / "stated", CAMERA)
    found = aerotri.check(tmp_path / "stated")
    assert (len(found.missing), found.notes) == (3, ())
    with pytest.raises(InputError, match="holds no photographs"):
        aerotri.read_block(tmp_path / "stated")
