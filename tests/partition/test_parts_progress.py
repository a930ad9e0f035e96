"""How far the adjustment of a block in parts is: told part by part."""

import itertools
import json

import aerotri
from small_blocks import LONG_FLIGHT, small_block, with_adjustment


def test_parts_done_within_an_iteration_are_told(tmp_path):
    block = with_adjustment(small_block(seed=4, flight=LONG_FLIGHT)[0], model_part="off")
    said = []
    found = aerotri.adjust_parts(
        aerotri.divide(block, tmp_path / "parts", parts=3),
        tmp_path / "result",
        plots=False,
        progress=lambda stage, share: said.append((stage, share)),
    )
    for stage in ("reading, 3 parts", "iteration 1, 3 parts", "iteration 2, 3 parts", "standard deviations, 3 parts"):
        shares = [share for words, share in said if words == stage]
        assert shares[:3] == [1 / 3, 2 / 3, 1.0], stage
    # what an iteration led to stands between its parts and those of the next
    stages = [words.split(",")[0].split(":")[0] for words, _ in said]
    assert [one for one, _ in itertools.groupby(stages)][:2] == ["reading", "iteration 1"]
    assert found.status == "converged"
    notes = json.loads((tmp_path / "result" / "adjustment.json").read_text(encoding="utf-8"))["notes"]
    assert any("weak points" in note for note in notes)
