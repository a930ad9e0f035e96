"""Damaged files in every reader: none may end in anything but a block, or an error that names file and remedy.

Every input is a good file with damage that knows its structure (tools/prove/fuzzing/mutations.py), drawn from the seed
and its number alone. Inputs run in forked processes of a warm program: 5 s each, 1 GiB beyond what the program itself
takes; a process that aborts or hangs is replaced. Findings are told apart by their place: the type of the exception
and the innermost frame of this program. What became of every input is kept beside the table: a run that was cut off
goes on with --go-on, and after a repair `--readers NAME --again` runs the inputs of that reader anew.

Example
-------
    python tools/prove/fuzz.py --inputs 100000 --out tools/results/fuzz.md
    python tools/prove/fuzz.py --inputs 20000 --readers las laz
    python tools/prove/fuzz.py --one 4711
    python tools/prove/fuzz.py --hostile
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

# one thread: a forked process must not wait for threads that it does not have
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from fuzzing.readers import all_targets  # noqa: E402
from fuzzing.table import Tally, markdown  # noqa: E402
from fuzzing.worker import Found, Target, input_of, run_inputs, warm_up, write_files  # noqa: E402

CHUNK = 1000


def main() -> None:
    """Run the inputs, print the table."""
    arguments = _arguments()
    if arguments.hostile:
        from fuzzing.hostile import run_hostile

        raise SystemExit(run_hostile())
    targets = all_targets()
    if arguments.one is not None:
        return _one(targets, arguments)
    begun, tally = time.perf_counter(), Tally()
    kept = None if arguments.out is None else arguments.out.with_suffix(".jsonl")
    known = _known(kept) if arguments.go_on or arguments.again else {}
    chosen = [k for k in range(arguments.inputs) if _is_chosen(targets[k % len(targets)], arguments.readers)]
    if not arguments.again:
        chosen = [k for k in chosen if k not in known]
    if kept is not None and not known:
        kept.unlink(missing_ok=True)
    with tempfile.TemporaryDirectory(prefix="aerotri_fuzz_") as folder:
        warm_up(targets, Path(folder))
        for part in _parallel(targets, arguments.seed, chosen, Path(folder), arguments.processes):
            known |= {found.number: found for found in part}
            if kept is not None:
                with kept.open("a", encoding="utf-8") as file:
                    file.writelines(json.dumps(asdict(found)) + "\n" for found in part)
            tally = Tally.of(known.values())
            seconds = time.perf_counter() - begun
            print(f"{tally.inputs} inputs, {seconds:.0f} s: {tally.in_short()}", flush=True)
            if arguments.out is not None:
                arguments.out.write_text(markdown(tally, arguments.seed), encoding="utf-8")
    print(markdown(tally, arguments.seed))
    raise SystemExit(1 if tally.findings else 0)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=2000, help="how many, over all readers")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--readers", nargs="*", default=[], help="only inputs of readers whose names begin so")
    parser.add_argument("--go-on", action="store_true", help="leave out inputs that --out knows already")
    parser.add_argument("--again", action="store_true", help="run inputs anew, and keep what --out knows of the others")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--one", type=int, help="write the files of one input to --keep and show what happens")
    parser.add_argument("--keep", type=Path, default=Path("fuzz_input"))
    parser.add_argument("--hostile", action="store_true", help="the damaged files of ../shared/data/hostile by command")
    parser.add_argument("--out", type=Path, help="table to write; what became of every input stands beside it, .jsonl")
    return parser.parse_args()


def _is_chosen(target: Target, readers: Sequence[str]) -> bool:
    return not readers or any(target.name.startswith(name) for name in readers)


def _known(path: Path | None) -> dict[int, Found]:
    """What became of inputs of earlier runs, the last word on each."""
    if path is None or not path.is_file():
        return {}
    found = (Found(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines())
    return {one.number: one for one in found}


def _parallel(
    targets: Sequence[Target], seed: int, numbers: list[int], folder: Path, processes: int
) -> Iterator[list[Found]]:
    """What became of the inputs, chunk by chunk, from forked processes that fork for the inputs again."""
    context = multiprocessing.get_context("fork")
    jobs, results = context.Queue(), context.Queue()
    chunks = [numbers[k : k + CHUNK] for k in range(0, len(numbers), CHUNK)]
    for chunk in [*chunks, *[None] * processes]:
        jobs.put(chunk)

    def work(number: int) -> None:
        while (chunk := jobs.get()) is not None:
            results.put(list(run_inputs(targets, seed, chunk, folder / str(number))))

    workers = [context.Process(target=work, args=(k,)) for k in range(processes)]
    for worker in workers:
        worker.start()
    for _ in chunks:
        yield results.get()
    for worker in workers:
        worker.join()


def _one(targets: Sequence[Target], arguments: argparse.Namespace) -> None:
    target, files = input_of(targets, arguments.seed, arguments.one)
    write_files(files, arguments.keep)
    print(target.name, [name for name in files if files[name] != target.files[name]])
    print(target.call(arguments.keep))


if __name__ == "__main__":
    main()
