"""Whether rank defects are found, and nothing else is taken for one, whatever the processor, the order and the units.

Every kind of lack has a block that has it and a twin with just enough. Each is written down in five ways (as it is,
rows permuted, other units twice, far from the origin) and looked at on three processors: this one, one without vector
instructions for our kernels (NUMBA_CPU_NAME=generic) with another BLAS kernel, and this one with a third BLAS kernel.
The singular values of the design matrix in full say what is right.

Example
-------
    python tools/prove/prove_defects.py --seeds 3 --out tools/results
"""

from __future__ import annotations

import argparse
import getpass
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import asdict
from itertools import groupby
from pathlib import Path

import numpy as np

from aerotri import __version__
from defects_proof.looks import Look, looks
from runs_elsewhere import Runs, add_executor, runs_of

PROCESSORS = {
    "this processor": {},
    "generic, Nehalem": {"NUMBA_CPU_NAME": "generic", "OPENBLAS_CORETYPE": "Nehalem"},
    "Haswell": {"NUMBA_CPU_NAME": "haswell", "OPENBLAS_CORETYPE": "Haswell"},
}
"""Environment of a process each; kernels of one are not those of another, so each has its own cache."""


def main() -> None:
    """Look on every processor, print the table, write it."""
    arguments = _arguments()
    if arguments.child:
        found = [asdict(look) for look in looks(range(arguments.first, arguments.first + arguments.seeds))]
        arguments.child.write_text(json.dumps(found), encoding="utf-8")
        return
    with runs_of(arguments) as runs:
        found = {name: _on(name, arguments.seeds, runs) for name in PROCESSORS}
    table = markdown(found, arguments.seeds)
    print(table)
    if arguments.out:
        arguments.out.mkdir(parents=True, exist_ok=True)
        (arguments.out / "prove_defects.md").write_text(table, encoding="utf-8")
    if not all(look.is_right for every in found.values() for look in every):
        raise SystemExit(1)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3, help="blocks of every case with other random numbers")
    parser.add_argument("--out", type=Path, help="folder for prove_defects.md")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--first", type=int, default=1, help=argparse.SUPPRESS)
    add_executor(parser)
    return parser.parse_args()


def _on(processor: str, seeds: int, runs: Runs) -> list[Look]:
    """All looks, each seed in a process of its own."""
    print(f"looking on {processor}", file=sys.stderr, flush=True)
    return [look for found in runs(_of_seed, processor, range(1, seeds + 1)) for look in found]


def _of_seed(processor: str, seed: int) -> list[Look]:
    """The looks of one seed; the kernels of a processor are kept on the machine for the next one."""
    cache = Path(tempfile.gettempdir()) / f"aerotri_defects_{getpass.getuser()}_{__version__}" / processor
    own = {"NUMBA_CACHE_DIR": str(cache), "OPENBLAS_NUM_THREADS": "1", "AEROTRI_THREADS": "1"}
    with tempfile.TemporaryDirectory(prefix="aerotri_defects_") as folder:
        out = Path(folder) / "looks.json"
        line = [sys.executable, __file__, "--child", out, "--seeds", "1", "--first", str(seed)]
        subprocess.run(line, env=os.environ | PROCESSORS[processor] | own, check=True)
        return [Look(**look) for look in json.loads(out.read_text(encoding="utf-8"))]


def markdown(found: dict[str, list[Look]], seeds: int) -> str:
    """The table: a row for every case, over seeds, variants and processors."""
    every = [look for list_of_one in found.values() for look in list_of_one]
    lacking, enough = [look for look in every if look.expected], [look for look in every if not look.expected]
    wrong = [look for look in every if not look.is_right]
    blocks = "one block" if seeds == 1 else f"{seeds} blocks"
    lines = [
        "# Rank defects: found, and only where there are any",
        "",
        f"{len({look.case for look in every})} kinds of lack, {blocks} of each and as many twins with just "
        f"enough, in {len({look.variant for look in every})} ways of writing them down, on {len(found)} processors "
        f"({', '.join(found)}): {len(lacking)} looks at deficient and {len(enough)} at determined blocks, "
        f"**{len(wrong)} wrong**.",
        "",
        "*Free* is the number of directions that are free, by construction, by the singular values of the whole design "
        "matrix (columns of length one) and by the adjustment; one number where all agree. *Singular values*: the "
        "largest of those that are zero but for rounding, and the smallest of the others. *λ* is the estimate of the "
        "smallest eigenvalue by the factor, from which the design matrix decides below 1e-10. *σ* is the largest "
        "relative difference of a σ of orientation or shared parameters from dense algebra.",
        "",
        "| what is looked at | looks | wrong | free | zero | not zero | smallest pivot | λ | σ |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    key = lambda look: (look.case, look.expected == 0)  # noqa: E731
    order = {key(look): place for place, look in reversed(list(enumerate(every)))}
    for (name, determined), group in groupby(sorted(every, key=lambda look: order[key(look)]), key):
        lines.append(_row(f"{name}{', and enough' if determined else ''}", list(group)))
    zero = max(look.singular[0] for look in every)
    least = min(look.singular[1] for look in every)
    lines += [
        "",
        f"Between the largest singular value that is zero ({zero:.0e}) and the smallest that is not ({least:.0e}) lies "
        f"a factor of {least / max(zero, 1e-300):.0e}; the limit is 1e-06.",
        "",
        *[f"- wrong: {look.case}, seed {look.seed}, {look.variant}: {look}" for look in wrong[:20]],
    ]
    return "\n".join(lines).rstrip() + "\n"


def _row(name: str, looks_of_one: list[Look]) -> str:
    numbers = sorted({look.expected for look in looks_of_one} | {look.dense for look in looks_of_one}
                     | {look.free for look in looks_of_one})  # fmt: skip
    cells = [
        name,
        str(len(looks_of_one)),
        str(sum(not look.is_right for look in looks_of_one)),
        "–".join(map(str, numbers)),
        _range([look.singular[0] for look in looks_of_one], max) if looks_of_one[0].expected else "",
        _range([look.singular[1] for look in looks_of_one], min),
        _range([look.pivot for look in looks_of_one], min),
        _range([look.estimate for look in looks_of_one], min),
        _range([look.sigma_error for look in looks_of_one], max),
    ]
    return f"| {' | '.join(cells)} |"


def _range(values: list[float], of) -> str:
    known = [value for value in values if np.isfinite(value)]
    return f"{of(known):.0e}" if known else ""


if __name__ == "__main__":
    main()
