"""The reference against the models, the readers and the constants that it speaks of."""

from __future__ import annotations

import json
import tomllib

import jsonschema
import pytest

from aerotri.adjustment.ray_status import RAY_STATUS
from aerotri.formats.block.journal import ACTIONS
from aerotri.formats.block.settings_model import BlockModel
from aerotri.formats.block.writer import TABLE_NAMES
from aerotri.observations.block import CONSTRAINT_KINDS
from aerotri.reference.adjust_tables import RESIDUALS
from aerotri.reference.block_keys import block_keys, block_tables, plan_keys, plan_tables, prior_keys
from aerotri.reference.block_tables import READERS, block_table_files
from aerotri.reference.files import described_files
from aerotri.reference.schemas import SHIPPED, json_files, schema_of, schema_texts
from aerotri.simulation.spec import SimulationSpec
from aerotri.terrain.picket_status import PicketStatus

BARE = "[camera.NAME]\nsize_px = [100, 80]\npixel_um = 5.0\nfocal_length_mm = 50.0\n"


def keys_of(model, prefix=""):
    """The names of all keys of a settings model, found by its JSON schema: another way than the reference goes."""
    schema = model.model_json_schema()

    def walk(node, path):
        node = schema["$defs"][node["$ref"].rsplit("/", 1)[1]] if "$ref" in node else node
        options = [one for one in node.get("anyOf", ()) if one.get("type") != "null"]
        if options:
            return walk(options[0], path)
        if "$ref" in node.get("items", {}):
            return walk(node["items"], path)
        inner = node.get("additionalProperties")
        if isinstance(inner, dict) and "$ref" in inner:
            below = walk(inner, f"{path}.NAME")
            return below if len(below) > 1 else [path]
        if "properties" not in node or set(node["properties"]) == {"value", "sigma", "fixed"}:
            return [path]
        return [key for name, below in node["properties"].items() for key in walk(below, f"{path}.{name}".lstrip("."))]

    return walk(schema, prefix)


def test_every_key_of_simulation_toml_is_described():
    def plain(name):
        return name.replace("[]", "")

    told = [plain(key.name) for key in plan_keys()]
    assert sorted(told) == sorted(keys_of(SimulationSpec))
    for key in plan_keys():
        assert len(key.text) > 10, key
        assert key.text.endswith("."), key
    assert {key.table for key in plan_keys()} == set(plan_tables())


def test_every_key_of_block_toml_is_described():
    assert [key.name for key in block_keys()] == keys_of(BlockModel)
    for key in (*block_keys(), *prior_keys()):
        assert len(key.text) > 10, key
        assert key.text.endswith("."), key
    assert set(block_tables()) == {key.table for key in block_keys()}


@pytest.mark.parametrize("key", [key for key in block_keys() if key.default], ids=lambda key: key.name)
def test_a_default_may_be_written(key):
    """The default as the reference prints it is what a block.toml without the key has."""
    line = f"{key.name.rsplit('.', 1)[-1]} = {key.default}\n"
    bare = BARE
    if key.table.startswith("rig.NAME"):
        bare += '[rig.NAME]\nreference = "cam"\n' + ("" if key.table == "rig.NAME" else f"{_table(key)}\n")
    table = "" if key.table.startswith("rig.NAME") else f"{_table(key)}\n"
    written = tomllib.loads(line + bare if key.table == "" else bare + table + line)
    given, without = BlockModel.model_validate(written), BlockModel.model_validate(tomllib.loads(bare))
    assert given == without


def _table(key):
    return "" if key.table == "camera.NAME" else f"[{key.table}]"


def test_tables_of_a_block_are_those_that_are_read():
    """Column by column, in both directions; columns that a reader needs are not optional."""
    assert [one.name.removesuffix(".csv") for one in block_table_files()] == list(TABLE_NAMES)
    for described in block_table_files():
        columns = READERS[described.name]
        own = [one for one in described.items if one.name != "*"]
        assert {one.name for one in own} == set(columns.known)
        assert {one.name for one in own if not one.optional} == set(columns.required)
        assert ("*" in described.columns) == columns.free_text


def test_words_are_those_of_the_program():
    words = {one.label: {item.name: set(item.values) for item in one.items} for one in described_files()}
    assert words["edits.csv (block folder)"]["action"] == set(ACTIONS)
    assert words["constraints.csv (block folder)"]["kind"] == set(CONSTRAINT_KINDS)
    assert words["pickets.parquet (folder of dtm)"]["status"] == {status.text for status in PicketStatus}
    assert set(next(item for item in RESIDUALS if item.name == "status").values) == set(RAY_STATUS)


def test_files_are_named_once_and_items_say_something():
    labels = [one.label for one in described_files()]
    assert len(labels) == len(set(labels))
    for described in described_files():
        assert described.form not in ("table", "json") or described.items, described.label
        assert len(described.columns) == len(set(described.columns)), described.label
        for item in (described, *described.items):
            assert item.text.endswith("."), (described.label, item)
            assert "{" not in item.text, (described.label, item)


@pytest.mark.parametrize("described", json_files(), ids=lambda one: one.label)
def test_schemas_are_schemas(described):
    schema = schema_of(described)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert json.loads(json.dumps(schema)) == schema


def test_the_schemas_of_the_package_are_those_of_the_reference():
    """`python -m aerotri.reference.schemas` writes them anew."""
    assert {path.name: path.read_text(encoding="utf-8") for path in SHIPPED.glob("*.json")} == schema_texts()
