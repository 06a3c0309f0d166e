"""What the planner knows of a scene: statistics measured on rendered frames, before any matching."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class SceneFacts:
    """Measured over one or more frames; shares are of the pixels that show something, 0 to 1.

    Thresholds and their sources stand with the effects that use them.
    """

    frames: int
    min_depth: float  # [m]
    max_depth: float  # [m]
    min_disparity: float  # [px]
    max_disparity: float  # [px]
    texture_rms: float  # RMS horizontal gradient of the left image [DN/px]
    textureless_share: float  # share farther than 20 px from texture
    textureless_radius: float  # largest distance to texture [px]
    weak_texture_share: float  # share with gradient / image noise < 0.5
    step_share: float  # share within 2 px of a disparity step >= 1 px
    large_step_share: float  # share within 2 px of a disparity step > 3 px
    step_contrast: float  # median ln(foreground texture / background texture) across steps
    occluded_share: (
        float  # share that nearer things hide from the right eye, estimated from disparity
    )
    grazing_share: float  # share with |ln(1 - dd/dx)| >= 0.4
    specular_share: float  # share with roughness < 0.3 that is no mirror
    highlight_shift: float  # 95th percentile of the highlight's disparity error there [px]
    mirror_share: float  # share with metallic > 0.5 and roughness < 0.1
    transparent_share: float  # share of transparent materials
    saturated_share: float  # share above 250 of 255
    dark_share: float  # share below 15 of 255
    blur_px: float  # 95th percentile of motion during the exposure [px]
    skew_px: float  # 95th percentile of motion during the shutter's read-out [px]
