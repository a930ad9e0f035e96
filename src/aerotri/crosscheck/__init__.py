"""The same block through other programs' solvers, and what differs against σ.

Two checks stand side by side. `colmap_check` hands the block, freed of its systematic image errors, to pycolmap's
bundle adjuster with the control as priors: geometry, datum and the covariance of the orientation. `paper_check` adjusts
the measurements themselves, self-calibration included, through Ceres with a forward model written from the papers
alone (`paper_*.py` import nothing of the functional model nor of the adjustment), and `pattern_check` compares every
pattern directly. A block with parameters that this model does not have is never said to agree.
"""

from aerotri.crosscheck.comparison import LIMIT, CovarianceDifference, CrosscheckResult, Difference, PeerCheck
from aerotri.crosscheck.run import crosscheck

__all__ = ["LIMIT", "CovarianceDifference", "CrosscheckResult", "Difference", "PeerCheck", "crosscheck"]
