"""What is put into words: whether a result may be used, and what is wrong where it may not."""

from aerotri.diagnosis.reason import ACCEPTED, DOUBTFUL, REJECTED, Reason
from aerotri.diagnosis.verdict import Verdict, judge

__all__ = ["ACCEPTED", "DOUBTFUL", "REJECTED", "Reason", "Verdict", "judge"]
