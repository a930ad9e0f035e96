"""Bundle block adjustment with self-calibration for aerial photographs, and how sure it is."""

__version__ = "0.1.0"
