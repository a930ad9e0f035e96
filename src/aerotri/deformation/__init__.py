"""What image errors do to heights: deformation of stereo models, and DEMs freed of it."""

from aerotri.deformation.block_models import BlockDeformation, deform_block
from aerotri.deformation.dem_correction import DemOutcome, correct_dem
from aerotri.deformation.dem_window import DemModels, dem_models
from aerotri.deformation.model_grid import Deformation, DemGround, FlatGround, deform_normal_case, deform_pair
from aerotri.deformation.restitution import Restitution, restitution_of

__all__ = [
    "BlockDeformation",
    "Deformation",
    "DemGround",
    "DemModels",
    "DemOutcome",
    "FlatGround",
    "Restitution",
    "correct_dem",
    "deform_block",
    "deform_normal_case",
    "deform_pair",
    "dem_models",
    "restitution_of",
]
