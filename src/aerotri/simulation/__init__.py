"""From a flight plan to a block with its truth."""

from aerotri.simulation.in_parts import simulate_parts
from aerotri.simulation.reading import parse_spec, read_spec
from aerotri.simulation.simulate import simulate, true_image_errors
from aerotri.simulation.spec import SimulationSpec
from aerotri.simulation.truth import ImageErrorSample, Truth, write_simulated, write_truth

__all__ = [
    "ImageErrorSample",
    "SimulationSpec",
    "Truth",
    "parse_spec",
    "read_spec",
    "simulate",
    "simulate_parts",
    "true_image_errors",
    "write_simulated",
    "write_truth",
]
