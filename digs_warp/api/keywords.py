"""The keyword settings by name and type, for editors: `digs-warp ... --help-all` says what each does."""

from pathlib import Path
from typing import Literal, TypedDict


class ReconstructSettings(TypedDict, total=False):
    """Of `reconstruct`: the flags of ``digs-warp reconstruct``."""

    poses: str
    feature_size: int
    features: int
    pairing: Literal["auto", "sequential", "exhaustive"]
    refine_focal: bool
    readout_time: float | None
    min_registered: float
    refine_poses: Literal["off", "auto", "on"]
    masks: Literal["capture", "folder", "depth"]
    instance: int | None
    mask_folder: Path | str | None
    ignore_mask: Path | str | None
    voxel_size: float | None
    target_points: int | None
    time_budget: float | None
    density: Literal["auto", "fixed", "adaptive"]
    max_splats: int
    sh_degree: int | None
    depth_weight: float | None
    fit_exposure: Literal["on", "off"]
    rolling_shutter: Literal["auto", "on", "off"]
    motion_blur: Literal["auto", "on", "off"]
    keep_course: bool
    device: str
    subject: Literal["auto", "object", "scene"]
    test_every: int


class SimulateSettings(TypedDict, total=False):
    """Of `simulate` and `stream`: the flags of ``digs-warp simulate``."""

    scene: tuple[Path, ...]
    environment: Path | str | None
    ground: Literal["auto", "floor", "table", "none"]
    profile: str | None
    width: int | None
    height: int | None
    samples_per_pixel: int
    tier: Literal["truth", "law", "guided", "matcher"]
    effects: str
    error_strength: float
    labels: str
    object_size: float | None
    mesh_unit: Literal["m", "cm", "mm", "in", "auto"]
    mesh_up: Literal["auto", "y", "z"]
    seed: int
    camera_path: Literal["orbits", "arc", "hover", "approach", "turntable"]
    elevations: tuple[float, ...]
    camera_distance: float | None
    camera_speed: float
    duration: float | None
    fps: float | None
