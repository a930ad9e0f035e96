"""What is put into words: whether a result may be used, and what is wrong where it may not."""

from aerotri.diagnosis.diagnose import diagnose
from aerotri.diagnosis.finding import Finding
from aerotri.diagnosis.verdict import Verdict, findings, judge

__all__ = ["Finding", "Verdict", "diagnose", "findings", "judge"]
