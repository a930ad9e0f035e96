"""Blocks spoilt as users spoil them, through the real command: verdict, exit code, and the cause that is said.

Every kind of tests/wrong_blocks.py is written as a block folder, adjusted by `aerotri adjust`, and its answer held
against the verdict and the words expected. A wrong block may be accepted only where its check points agree with their
σ. Exits with 1 where a row misses.

Example: python tools/prove/wrong_blocks.py > tools/results/wrong_blocks.md
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from wrong_blocks import Kind, answer_of, clean, kinds, misses


def row(kind: Kind, folder: Path) -> tuple[str, list[str]]:
    """One line of the table, and what it misses."""
    answer = answer_of(kind.spoil(clean(kind.geometry)), folder)
    wrong = misses(kind, answer)
    cells = [
        kind.name, kind.geometry, answer.verdict, str(answer.exit_code), f"{answer.sigma0:.3g}", f"{answer.check:.3g}",
        ", ".join(f"“{word}”" for word in kind.words if word in answer.text) or "–", "; ".join(wrong) or "yes",
        answer.cause.replace("|", "/"),
    ]  # fmt: skip
    return "| " + " | ".join(cells) + " |", wrong


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="kinds whose name or geometry holds this text")
    chosen = [kind for kind in kinds() if parser.parse_args().only in f"{kind.geometry} {kind.name}"]
    print("# Wrong blocks\n")
    print(
        "Simulated blocks spoilt in one way each, through `aerotri adjust`. “check” is the RMS of the check points "
        "over their σ; “said” the words of the cause that had to occur and did; the first four rows are the faultless "
        "blocks.\n"
    )
    print("| kind | geometry | verdict | exit | σ₀ | check | said | as expected | first reason |")
    print("|---|---|---|---|---|---|---|---|---|")
    failed = 0
    with tempfile.TemporaryDirectory() as place:
        faultless = [
            Kind("none: the block as it was", geometry, lambda block: block, (), ("accepted",))
            for geometry in ("navigation", "control", "track", "crs")
        ]
        for number, kind in enumerate([*faultless, *chosen]):
            line, wrong = row(kind, Path(place) / str(number))
            failed += bool(wrong)
            print(line, flush=True)
    print(f"\n{len(chosen)} kinds of wrong block, {failed} rows not as expected.")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
