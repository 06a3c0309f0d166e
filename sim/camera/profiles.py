"""Stereo cameras as data: every figure has its origin, so that readers know what to trust.

A profile is a base profile plus its own figures. The built-in profiles follow published figures of the ZED
2, the RealSense D435 and the OAK-D as far as these exist; "class" in their titles means that they are
bounded by such data, not fitted to one device. A custom profile is a YAML file:

    title: my stereo head
    base: zed2-720
    figures:
      baseline: {value: 0.2, origin: measured, note: calibration of 3 May}
      static_field: {value: 0.0, origin: tuned}
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal, get_args

from digs_warp.checks import DigsError
from digs_warp.geometry.camera import Intrinsics
from digs_warp.record.fields import shown
from digs_warp.record.files import read_yaml
from digs_warp.sim.camera.rig import StereoRig
from digs_warp.words import did_you_mean

Origin = Literal["measured", "vendor", "tuned"]

# Figures in addition to those of the rig: the native image size and its focal length [px].
IMAGE_FIGURES = ("width", "height", "focal")
RIG_FIGURES = tuple(field.name for field in fields(StereoRig) if field.name != "intrinsics")


@dataclass(frozen=True)
class Figure:
    """One number of a profile.

    Attributes:
        value: in the unit of the rig's field of that name.
        origin: measured (on a device or a real pair), vendor (data sheet), tuned (chosen to fit).
        note: its source.
    """

    value: float
    origin: Origin
    note: str = ""


@dataclass(frozen=True)
class Profile:
    """A camera model.

    Attributes:
        name: as --profile takes it.
        title: for reports.
        figures: every figure of IMAGE_FIGURES and RIG_FIGURES by name.
    """

    name: str
    title: str
    figures: Mapping[str, Figure]

    def __post_init__(self) -> None:
        unknown = sorted(set(self.figures) - set(IMAGE_FIGURES) - set(RIG_FIGURES))
        missing = [n for n in IMAGE_FIGURES + RIG_FIGURES if n not in self.figures]
        if unknown or missing:
            raise DigsError(
                f"profile '{self.name}': unknown figures {unknown}, missing figures {missing}; "
                f"expected {', '.join(IMAGE_FIGURES + RIG_FIGURES)}"
            )

    def rig(
        self,
        width: int | None = None,
        height: int | None = None,
        horizontal_fov_deg: float | None = None,
    ) -> StereoRig:
        """Return the rig, by default at the native image size and angle.

        Args:
            width: of the image [px].
            height: of the image [px].
            horizontal_fov_deg: another angle of view, for example of a crop or another lens.
        """
        native_width = int(self.figures["width"].value)
        width = width or native_width
        height = height or round(width * self.figures["height"].value / native_width)
        if horizontal_fov_deg is None:
            focal = self.figures["focal"].value * width / native_width
            intrinsics = Intrinsics(width, height, focal, focal, width / 2, height / 2)
        else:
            intrinsics = Intrinsics.from_fov(width, height, horizontal_fov_deg)
        values: dict[str, Any] = {name: self.figures[name].value for name in RIG_FIGURES}
        values |= {name: int(values[name]) for name in ("window", "unit")}
        return StereoRig(intrinsics=intrinsics, **values)


def _figures(origin: Origin, note: str, **values: float) -> dict[str, Figure]:
    return {name: Figure(value, origin, note) for name, value in values.items()}


# Of the tier "law", where no figures of a device are known.
_NO_DEVICE = {
    **_figures("tuned", "not compared with a device", disparity_correlation=16.0),
    **_figures("tuned", "not compared with a device", temporal_share=0.2),
    **_figures("tuned", "not compared with a device", disparity_distortion=0.0, hole_share=0.0),
}

_MATCHER = {
    **_figures("measured", "semi-global matching, synthetic pairs", window=5),
    **_figures("measured", "fixed point of semi-global matchers", disparity_step=1 / 16),
    # Measured 0.15 to 0.2 px there, including the error of the ground truth; range data of the first ZED
    # limit it.
    **_figures("tuned", "bounded by range data of the ZED (v1)", static_field=0.1),
    **_figures("tuned", "high-frequency error of a real pair: 0.10-0.15 px", disparity_sigma=0.1),
    **_figures("tuned", "any specimen", unit=0),
    **_NO_DEVICE,
    **_figures("tuned", "a bare matcher", least_confidence=0.0, smoothing=0.0),
    # Vendors state depth errors below 1 to 2 % at 2 to 4 m, which are 0.2 to 0.4 px: two standard deviations.
    **_figures("tuned", "half of the vendors' depth errors, 0.1-0.2 px", rotation_drift=0.01),
    **_figures("tuned", "lens that warms by 10 K, 0.1-0.2 px at the sides", focal_drift=2e-4),
    **_figures("tuned", "aluminum that warms by 20 K, 0.05 px at 100 px", baseline_drift=5e-4),
    **_figures("tuned", "indoor light", exposure_time=0.01, image_noise=2.0),
    **_figures("tuned", "20 ms, two periods of lamps at 50 Hz, before gain", exposure_headroom=1.0),
    # libcamera's controllers for the Raspberry Pi go a fifth (exposure) and a twentieth (white balance) of
    # the way with every frame.
    **_figures("tuned", "as libcamera's controller at 15 frames/s", exposure_lag=0.3),
    **_figures("tuned", "as libcamera's controller at 15 frames/s", white_balance_lag=1.3),
    **_figures("tuned", "half of what gray-world would remove", white_balance=0.5),
    **_figures("tuned", "small pixels at indoor gain", full_well=4_400.0, vignetting=0.3),
    **_figures("vendor", "no projector", projector_power=0.0, projector_offset=0.0),
    **_figures("vendor", "the left eye takes the images", color_offset=0.0, color_zoom=1.0),
    **_figures("vendor", "no other camera", color_noise=0.0),
}

_ZED2 = {
    **_MATCHER,
    **_figures("vendor", "data sheet", baseline=0.12, min_depth=0.3, max_depth=20.0),
    **_figures("tuned", "no limit but the nearest depth", max_disparity=0.0),
}

_CALIBRATED = "factory calibration of one device"
_LINES = "line time x lines, vendor's support pages"

# Differences between the image modes.
_ZED2_MODES = {
    "2K": {
        **_figures("vendor", "image mode", width=2208, height=1242),
        **_figures("measured", _CALIBRATED, focal=1063.98),
        **_figures("vendor", _LINES, readout_time=0.0556),
    },
    "1080": {
        **_figures("vendor", "image mode", width=1920, height=1080),
        **_figures("tuned", "taken for a crop of the 2K mode", focal=1063.98),
        **_figures("vendor", _LINES, readout_time=0.0276),
    },
    "720": {
        **_figures("vendor", "image mode", width=1280, height=720),
        **_figures("measured", _CALIBRATED, focal=531.99),
        **_figures("vendor", _LINES, readout_time=0.0184),
    },
    "VGA": {
        **_figures("vendor", "image mode", width=672, height=376),
        **_figures("tuned", "half of the 720 mode", focal=265.995),
        **_figures("tuned", "376 lines at the line time of the 720 mode", readout_time=0.0096),
    },
}

_D435_PLANES = "ten frames of boxes and walls"

_D435 = {
    **_MATCHER,
    **_figures("vendor", "image mode", width=848, height=480),
    **_figures("vendor", "90 degrees across", focal=424.0),
    **_figures("vendor", "data sheet", baseline=0.05),
    **_figures("tuned", "where noise reaches 0.4 m", max_depth=10.0),
    **_figures("vendor", "search range of the depth chip", max_disparity=126.0),
    **_figures("vendor", "f b / 126 px", min_depth=0.168),
    **_figures("vendor", "1/32 px", disparity_step=1 / 32),
    # Residuals to planes in windows of 8 to 64 px at 1.2 m: .020, .033, .071, .106 px (d435_planes of the
    # sample data). The vendor's engineers say .08 px.
    **_figures("measured", _D435_PLANES, disparity_sigma=0.13, disparity_correlation=16.0),
    **_figures("tuned", "as a Gemini 335", temporal_share=0.2),
    **_figures("tuned", "its noise does not fall with distance", disparity_distortion=0.0),
    **_figures("measured", _D435_PLANES, hole_share=0.035),
    **_figures("tuned", "holes of the ten frames", least_confidence=0.905),
    **_figures("tuned", "residuals of the ten frames", smoothing=0.45),
    **_figures("tuned", "0.11 px; the vendor's 2 % at 2 m allow twice that", rotation_drift=0.015),
    **_figures("vendor", "global shutter of the infrared pair", readout_time=0.0),
    # realsense_d435_ir_pair of the sample data: 0.24 of full white on a gray box 0.42 m away. Its reflectance
    # is unknown; 0.34 is taken.
    **_figures("tuned", "dots of a real pair, reflectance guessed", projector_power=0.2),
    **_figures("tuned", "between the eyes; no published figure", projector_offset=0.025),
    # realsense2_description/urdf/_d435.urdf.xacro: 15 mm on the side of the left eye.
    **_figures("vendor", "the vendor's URDF", color_offset=-0.015),
    # Across, 69.4 degrees (manual of the FRAMOS D435e, 3.4) for 90 of the infrared eyes.
    **_figures("vendor", "69.4 for 90 degrees across", color_zoom=1.444),
    # The gray box of the real pair: 0.47 DN between its dots, rounding (0.29) included, at 48 DN.
    **_figures("measured", "infrared images of a real pair", image_noise=0.25),
    **_figures("tuned", "indoor light", color_noise=2.0),
}

_D455 = {
    **_D435,
    **_figures("vendor", "data sheet", baseline=0.095),
    **_figures("vendor", "f b / 126 px", min_depth=0.32),
    **_figures("tuned", "where noise reaches 0.4 m", max_depth=14.0),
    **_figures("tuned", "between the eyes; no published figure", projector_offset=0.0475),
    # realsense2_description/urdf/_d455.urdf.xacro: 59 mm on the side of the right eye; 90 degrees across.
    **_figures("vendor", "the vendor's URDF", color_offset=0.059),
    **_figures("vendor", "90 for 90 degrees across", color_zoom=1.0),
    # .031, .068, .113, .124 px in windows of 8 to 64 px.
    **_figures("measured", "a flat board at 0.7 to 1 m", disparity_sigma=0.133),
    **_figures("measured", "a flat board at 0.7 to 1 m", disparity_correlation=9.0),
}

# A white board at 0.5 to 3 m, by github.com/ychen921/rgbd-characterization (2026).
_BOARD = "a white board at 0.5 to 3 m, published"

_GEMINI_335 = {
    **_D435,
    **_figures("measured", "calibration of that unit", focal=412.45),
    **_figures("vendor", "data sheet", max_depth=20.0, color_zoom=1.0),
    **_figures("tuned", "the search range of a D435", min_depth=0.1637),
    **_figures("tuned", "depth stays in the left eye's image", color_offset=0.0),
    **_figures("tuned", "too fine to be seen in the noise", disparity_step=1 / 64),
    **_figures("measured", "hardly any holes on the board", least_confidence=0.0),
    **_figures("measured", _BOARD, disparity_sigma=0.0313, temporal_share=0.73),
    **_figures("measured", _BOARD, disparity_distortion=0.0022, hole_share=0.0),
    **_figures("measured", _BOARD, disparity_correlation=8.0),
}

_OAKD = {
    **_MATCHER,
    **_figures("vendor", "image mode", width=1280, height=800),
    **_figures("vendor", "calibration of an 800P unit", focal=882.5),
    **_figures("vendor", "data sheet", baseline=0.075),
    **_figures("tuned", "where noise reaches 0.5 m", max_depth=15.0),
    **_figures("vendor", "95 px search", max_disparity=95.0, min_depth=0.697),
    **_figures("vendor", "3 sub-pixel bits", disparity_step=1 / 8),
    # Vendor's medians (2 % at 4 m, 4 % at 7 m) are bounds with bias: they allow 0.3 px.
    **_figures("tuned", "census matching, below the vendor's bound", disparity_sigma=0.15),
    **_figures("vendor", "global shutter", readout_time=0.0),
}

PROFILES = {
    **{
        f"zed2-{mode.lower()}": Profile(
            f"zed2-{mode.lower()}", f"ZED-2 class, {mode}", {**_ZED2, **figures}
        )
        for mode, figures in _ZED2_MODES.items()
    },
    "d435": Profile("d435", "RealSense-D435 class", _D435),
    "d455": Profile("d455", "RealSense-D455 class", _D455),
    "gemini-335": Profile("gemini-335", "Orbbec-Gemini-335 class", _GEMINI_335),
    "oak-d": Profile("oak-d", "OAK-D class", _OAKD),
}


def load_profile(source: str | Path) -> Profile:
    """Return a built-in profile by name, or read a custom one from a YAML file.

    Raises:
        DigsError: unknown name, missing file, or a file that does not describe a profile.
    """
    if str(source) in PROFILES:
        return PROFILES[str(source)]
    if Path(source).suffix.lower() not in (".yaml", ".yml"):
        raise DigsError(
            f"profile '{source}': not known{did_you_mean(str(source), PROFILES)}, or a .yaml file"
        )
    return _read_profile(Path(source))


def _read_profile(path: Path) -> Profile:
    content = read_yaml(path, "profile")
    if not isinstance(content.get("figures"), dict):
        raise DigsError(f"profile '{path}': expected a mapping with 'figures', see docs/sensor.md")
    base = content.get("base", "zed2-720")
    if not isinstance(base, str) or base not in PROFILES:
        raise DigsError(
            f"profile '{path}': base {shown(base)}, expected one of {', '.join(PROFILES)}"
        )
    own = {name: _read_figure(path, name, entry) for name, entry in content["figures"].items()}
    return Profile(
        path.stem, str(content.get("title", path.stem)), {**PROFILES[base].figures, **own}
    )


def _read_figure(path: Path, name: str, entry: object) -> Figure:
    place = f"profile '{path}': figure '{name}'"
    if not isinstance(entry, dict) or not isinstance(entry.get("value"), int | float):
        raise DigsError(f"{place}: found {shown(entry)}, expected {{value: number, origin: ...}}")
    if entry.get("origin") not in get_args(Origin):
        raise DigsError(
            f"{place}: origin {entry.get('origin')!r}, expected one of {', '.join(get_args(Origin))}"
        )
    return Figure(float(entry["value"]), entry["origin"], str(entry.get("note", "")))
