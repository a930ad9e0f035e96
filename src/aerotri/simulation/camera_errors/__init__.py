"""What is wrong with a simulated camera: image errors by parameters, and by physics that no parameter set knows."""

from aerotri.simulation.camera_errors.fields import ImageError, image_error_fields, rms_mm

__all__ = ["ImageError", "image_error_fields", "rms_mm"]
