"""Workers as jobs of SLURM, and a command of aerotri on them: python slurm.py dsm RESULT PHOTOGRAPHS --out DSM

Needs: pip install 'aerotri[cluster]' dask-jobqueue, in an environment that the nodes see as well.
Change what is marked. See the job that is handed in: python slurm.py --show
"""

import subprocess
import sys

from dask_jobqueue import SLURMCluster

JOBS = 10  # change: jobs at most


def main() -> int:
    cluster = SLURMCluster(
        queue="compute",  # change: partition
        account="surveying",  # change, or leave out
        cores=8,
        processes=8,  # as many as cores: one thread a worker
        memory="24GB",  # of a job: 3 GB for each of its 8 workers
        walltime="04:00:00",
        interface="ib0",  # change: network that the nodes have in common, see `ip link`
        local_directory="/tmp",
        job_script_prologue=[
            "export AEROTRI_THREADS=1 OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1",
            "export NUMBA_CACHE_DIR=/tmp/numba_$USER",
        ],
        worker_extra_args=["--resources", "MEMORY=3e9"],  # of a worker
    )
    if sys.argv[1:] == ["--show"]:
        print(cluster.job_script())
        return 0
    cluster.adapt(minimum_jobs=1, maximum_jobs=JOBS)
    return subprocess.run(["aerotri", *sys.argv[1:], "--executor", f"dask:{cluster.scheduler_address}"]).returncode


if __name__ == "__main__":
    raise SystemExit(main())
