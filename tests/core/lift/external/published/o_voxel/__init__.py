"""As `o_voxel`."""

from . import postprocess as postprocess
