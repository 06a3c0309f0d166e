"""Names of the USD schema and of our own metadata, each in one place.

The attributes are those of ``UsdVol.ParticleField3DGaussianSplat`` (OpenUSD 26.03 and later). Every
array has a half-precision twin of the same name plus ``h``.
"""

SUFFIXES = (".usda", ".usdc", ".usdz", ".usd")

# In our metadata: what was taken off the places of a recording far from the origin [m].
OFFSET_KEY = "world_offset"

# Paths of the prims in our scenes.
ASSET_PATH = "/Asset"
GAUSSIANS_PATH = "/Asset/Gaussians"
RIG_PATH = "/Asset/Rig"
RENDER_PATH = "/Render"
SOURCE_PATH = "/Asset/Source"
MESH_PATH = "/Asset/Source/Mesh"
SURFACE_PATH = "/Asset/Source/Surface"
# The variant set of the asset: how many of the Gaussians.
LOD_SET = "lod"
# Importers take the package member with this stem for the scene (3dgrut does).
PACKAGE_ROOT = "default.usdc"

# The prim type and its attributes.
FIELD_TYPE = "ParticleField3DGaussianSplat"
# The same attributes are also allowed on the general type, with the ellipsoid kernel applied.
GENERAL_FIELD_TYPE = "ParticleField"
KERNEL_SCHEMA = "ParticleFieldKernelGaussianEllipsoidAPI"
POSITIONS = "positions"  # point3f[], local frame; its length is the number of splats
ORIENTATIONS = "orientations"  # quatf[]: wxyz in text and Gf, xyzw in the buffer
SCALES = "scales"  # float3[], linear standard deviations
OPACITIES = "opacities"  # float[], 0..1
SH_DEGREE = "radiance:sphericalHarmonicsDegree"
SH_COEFFICIENTS = "radiance:sphericalHarmonicsCoefficients"  # float3[], splat after splat
HALF_SUFFIX = "h"
# The arrays, with the length of their rows; None: plain numbers. Reading, writing and checking go by it.
WIDTHS = {POSITIONS: 3, ORIENTATIONS: 4, SCALES: 3, OPACITIES: None, SH_COEFFICIENTS: 3}
PROJECTION_HINT = "projectionModeHint"
SORTING_HINT = "sortingModeHint"
EXTENT = "extent"
DISPLAY_COLOR = "primvars:displayColor"

# What the schema says an unauthored degree means.
FALLBACK_DEGREE = 3

# Our rasterizer projects with the local affine approximation and sorts by planar depth.
PROJECTION_MODE = "perspective"
SORTING_MODE = "zDepth"

# Splat colors are optimized and blended as sRGB values. OpenUSD has no name for that; this one is
# used by KHR_gaussian_splatting and NVIDIA, and the asset defines it, so that it resolves everywhere.
SPLAT_COLOR_SPACE = "srgb_rec709_display"
COLOR_SPACE_INSTANCE = "display"
# For viewers that do not draw splats; linear, as USD expects displayColor to be.
DISPLAY_COLOR_SPACE = "lin_rec709_scene"

# Our metadata: of the layer, and of the asset prim.
METADATA_KEY = "digs_warp"
VERSION_KEY = "version"
SOURCE_TO_ASSET_KEY = "digs_warp:sourceToAsset"
# Facts about the recording on the rig's prim; entry i belongs to time code i.
VIEW_NAMES_KEY = "digs_warp:viewNames"
VIEW_TIMES_KEY = "digs_warp:viewTimes"  # [s]
HELD_OUT_KEY = "digs_warp:heldOut"
