"""The chain of stages from a block to its result; `chain` is its beginning.

chain       block → with chosen parameters → in its frame → variance components → verdict
in_frame    block → local frame → local adjustment → CRS of the block
local       start values → solution → gross errors → fields → selection → datum → statistics → loose points
components  the σ of groups, estimated by adjusting again
choosing    sets of additional parameters compared, and the choice among them
verdict     what is to be thought of the result, and which usual mistake explains it
reopening   the same adjustment from its saved solution
"""

from aerotri.pipeline.chain import adjust, adjust_and_explain, adjust_keeping_system
from aerotri.pipeline.choosing import compare_parameters
from aerotri.pipeline.reopening import reopen
from aerotri.pipeline.verdict import judged
from aerotri.results.adjustment import Adjustment
from aerotri.results.failure import AdjustmentFailedError

__all__ = [
    "Adjustment",
    "AdjustmentFailedError",
    "adjust",
    "adjust_and_explain",
    "adjust_keeping_system",
    "compare_parameters",
    "judged",
    "reopen",
]
