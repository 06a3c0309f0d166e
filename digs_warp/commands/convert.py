"""`digs-warp convert`: captures and Gaussians -> other programs' formats, recordings -> captures."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from digs_warp.checks import DigsError
from digs_warp.commands.command import Command, SplatOptions
from digs_warp.commands.output import OutputFolder, check_output_file
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.formats.captures.formats import (
    EXPORTERS,
    RECORDINGS,
    CaptureFormat,
    RecordingFormat,
)
from digs_warp.record.layout import RUN_RECORD, find_gaussians
from digs_warp.record.run_log import RunLog
from digs_warp.settings import FIELD_OF_VIEW, FRAMES, SIDE, Range, Settings
from digs_warp.words import counted

if TYPE_CHECKING:
    from digs_warp.data.capture import Capture
    from digs_warp.formats.captures.recording import RecordedFrame, Recording
    from digs_warp.geometry.camera import Intrinsics
    from digs_warp.pipeline.reconstruction import Reconstruction


logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class SplatConversion(SplatOptions, Settings):
    """For Gaussians: what the files of other programs do not say or leave open."""

    spz_sh_bits: Annotated[tuple[int, int], Range(1, 8)] = (5, 4)
    """Bits of the view-dependent color in SPZ files, of band 1 and of the bands above, 1 to 8: more for
    quality, fewer for size."""

    vertex_colors: bool = True
    """Also write red, green and blue to PLY files, so that Open3D, trimesh and MeshLab show the splats as
    colored points. Leave them out for programs that expect rows of floats only: the SIBR viewer of 3D
    Gaussian splatting, and old versions of UnityGaussianSplatting."""

    made_for: Annotated[Literal["classic"] | None, tyro.conf.arg(name="for")] = None
    """For files other than .npz and USD: classic makes splats thinner by what most viewers add on the screen
    (0.3 px² at every distance), so that they show them as this program does. Best near one image size, that
    of the recording or --for-width. Default: as they are, for viewers that add nothing."""

    for_width: Annotated[int | None, SIDE] = None
    """With --for classic: width of the images in which the splats are looked at [px], for the field of view
    of the recording. Default: that of its images."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.for_width is not None and self.made_for is None:
            raise DigsError("--for-width needs --for classic")


@dataclass(frozen=True, kw_only=True)
class RecordingOptions(Settings):
    """How a recording becomes a capture."""

    frames: Annotated[int | None, FRAMES] = None
    """For recordings: take at most this number of frames, evenly spread; of a film, the sharpest near each of
    these moments. Default: all, of a film 120."""

    fov_deg: Annotated[float | None, FIELD_OF_VIEW] = None
    """For recordings with lens distortion, such as fisheye: horizontal field of view of the undistorted
    images [degrees]. Default: the same focal length, so that the center stays as sharp as it is. For a
    film: the field of view of its camera."""

    register_depth: str | None = None
    """For depth of another camera than the images': found moves it by the shift and size at which its edges
    fit theirs; kinect takes the calibration of the first Kinect; a JSON file gives yours: w, h, fl_x, fl_y,
    cx and cy of the depth camera and, if it is elsewhere, color_from_depth (4 x 4, metres). Default: as
    recorded."""


@dataclass(frozen=True, kw_only=True)
class Convert(Command):
    """Convert Gaussians, captures and recordings between file formats.

    Gaussians: 'digs-warp convert out/reconstruction --out scene.spz' or 'digs-warp convert a.ply --out
    b.usdz', with any two of .npz, .ply, .compressed.ply, .spz, .splat, .sog, .glb, .usdz, .usdc and .usda.

    A capture, for another program: 'digs-warp convert out/capture --to colmap --out out/colmap'.

    A recording of a real camera becomes a capture: 'digs-warp convert my/recording --from tum --out
    out/capture'.
    """

    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    """A capture folder; or Gaussians: a reconstruction folder or a file; or, with --from, a recording."""

    out: Path
    """The file or folder to write. A folder must be new or empty, unless --overwrite is given."""

    overwrite: tyro.conf.FlagCreatePairsOff[bool] = False
    """Replace the file, or the results of an earlier run in the folder, once the new ones are complete."""

    to: Annotated[CaptureFormat | None, tyro.conf.arg(metavar="FORMAT")] = None
    """For a capture, or for a reconstruction of it with the poses and masks that that used: the format to
    write. colmap (binary), colmap-text, nerfstudio (also for OpenSplat), tum, bop, redwood (for Open3D), hdf5
    (as BlenderProc writes it) or webdataset;
    with the labels of 'digs-warp simulate --labels disparity,flow' also a data set for stereo: kitti-stereo
    (2015), sceneflow (as FlyingThings3D) or middlebury (2014)."""

    recorded_as: Annotated[RecordingFormat | None, tyro.conf.arg(name="from")] = None
    """For a recording of a real RGB-D camera: the format of its folder (see docs/recordings.md). The result
    is a capture."""

    recording: Annotated[RecordingOptions, tyro.conf.OmitArgPrefixes] = field(
        default_factory=RecordingOptions
    )
    gaussians: Annotated[SplatConversion, tyro.conf.OmitArgPrefixes] = field(
        default_factory=SplatConversion
    )

    def __post_init__(self) -> None:
        if self.recorded_as is not None and self.to is not None:
            raise DigsError(
                "--from and --to together: convert the recording to a capture first, then the capture"
            )

    def execute(self) -> str:
        """Find out what the source is, and convert it."""
        if not self.source.exists():
            raise DigsError(f"'{self.source}': no such file or folder. Check the path.")
        if self.recorded_as is not None:
            return import_recording(
                self.source, self.recorded_as, self.out, self.overwrite, self.recording
            )
        if self.to is not None:
            return export_capture_folder(self.source, self.to, self.out, self.overwrite)
        if (self.source / INDEX_NAME).is_file():
            raise DigsError(
                f"'{self.source}': a capture; add --to with one of {', '.join(EXPORTERS)}"
            )
        try:
            find_gaussians(self.source)
        except DigsError as error:
            forms = ", ".join(RECORDINGS)
            raise DigsError(
                f"{error}; for a recording of a real camera add --from with one of {forms}"
            ) from None
        return convert_splats(self.source, self.out, self.overwrite, self.gaussians)


def export_capture_folder(source: Path, form: CaptureFormat, out: Path, overwrite: bool) -> str:
    """Export a capture, or that of a reconstruction as used; the folder is complete or not there."""
    from digs_warp.formats.captures.formats import export_capture
    from digs_warp.pipeline.scene_files import posed_capture

    capture = posed_capture(source)
    log = RunLog("convert", {"capture": source, "to": form}, results={"frames": len(capture)})
    with OutputFolder(out=out, overwrite=overwrite).opened(
        [source, capture.stored_in], can_resume=False
    ) as folder:
        with log.stage("export"):
            export_capture(capture, form, folder)
            if form == "bop":
                _add_bop_model(capture, folder)
        log.save(folder / RUN_RECORD)
    return f"{out}: {counted(len(capture), 'frame')} as {form}, {log.seconds['export']:.1f} s"


def _add_bop_model(capture: "Capture", folder: Path) -> None:
    """Write the recorded object as the model that the poses are of, where it is known."""
    from digs_warp.formats.captures.bop import write_bop_models
    from digs_warp.surface.true_surface import read_true_surfaces

    try:
        surfaces = read_true_surfaces(capture.folder)
    except DigsError as error:
        logger.warning("%s; the data set gets no models", error)
        return
    if surfaces is not None:
        write_bop_models(capture, surfaces, folder)


def import_recording(
    source: Path, form: RecordingFormat, out: Path, overwrite: bool, options: RecordingOptions
) -> str:
    """Write the capture of a recording; the folder is complete or not there."""
    from digs_warp.formats.captures.formats import opened_recording
    from digs_warp.formats.captures.to_capture import write_capture

    log = RunLog("convert", {"recording": source, "from": form, **vars(options)})
    with (
        OutputFolder(out=out, overwrite=overwrite).opened([source], can_resume=False) as folder,
        opened_recording(source, form, options.frames, options.fov_deg) as recording,
    ):
        with log.stage("convert"):
            if options.register_depth is not None:
                recording = with_depth_camera(recording, options.register_depth)
            capture = write_capture(recording, form, folder)
        log.results = {"frames": len(capture), "poses_known": capture.knows_poses}
        log.save(folder / RUN_RECORD)
    other = " or --poses rgbd" if capture.has_depth else ""
    hint = (
        ""
        if capture.knows_poses
        else f"; poses unknown: 'reconstruct --poses sfm'{other} finds them"
    )
    return (
        f"{out}: {counted(len(capture), 'frame')} from {form}, {log.seconds['convert']:.1f} s{hint}"
    )


def with_depth_camera(recording: "Recording", how: str) -> "Recording":
    """Return a recording with the camera of its depth, as `RecordingOptions.register_depth` says it."""
    from digs_warp.data.images import read_image
    from digs_warp.formats.captures.recording import DepthCamera
    from digs_warp.formats.captures.seven_scenes import kinect_depth_camera
    from digs_warp.geometry.camera import Intrinsics
    from digs_warp.record.fields import ABOVE_ZERO, Fields
    from digs_warp.record.files import read_json

    frames = [frame for frame in recording.frames if frame.depth is not None]
    if not frames:
        raise DigsError(f"--register-depth: recording '{recording.folder}' has no depth")
    assert frames[0].depth is not None
    height, width = read_image(frames[0].depth, "depth").shape[:2]
    if how == "kinect":
        camera = kinect_depth_camera(width, height)
    elif how == "found":
        camera = DepthCamera(_fitting_camera(recording, frames).resized(width, height))
    else:
        given = Fields(read_json(Path(how), "--register-depth"), f"'{how}'")
        size = given.whole("w", 1), given.whole("h", 1)
        numbers = (given.number(name, ABOVE_ZERO) for name in ("fl_x", "fl_y", "cx", "cy"))
        moved = given.array("color_from_depth", (4, 4)) if "color_from_depth" in given else None
        camera = DepthCamera(Intrinsics(*size, *numbers), moved)
    return replace(recording, depth_camera=camera)


def _fitting_camera(recording: "Recording", frames: "Sequence[RecordedFrame]") -> "Intrinsics":
    """Return the camera of the depth, of the size of the images, at which its edges lie on theirs."""
    from digs_warp.check.alignment import LOOKED_AT, registration, thumbnail_of
    from digs_warp.check.thresholds import REGISTRATION_CERTAINTY
    from digs_warp.data.viewpoints import evenly
    from digs_warp.formats.captures.to_capture import load_frame

    some = evenly(frames, LOOKED_AT)
    loaded = (load_frame(frame, recording) for frame in some)
    found = registration(
        thumbnail_of(each.image, each.depth) for each in loaded if each.depth is not None
    )
    if found is None or found.certainty < REGISTRATION_CERTAINTY or found.at_rim:
        raise DigsError(
            f"--register-depth found: recording '{recording.folder}': its edges of depth fit those of its "
            "images nowhere clearly better than elsewhere; give the calibration of the depth camera: "
            "--register-depth kinect, or a JSON file"
        )
    logger.warning("recording '%s': the depth is moved by %s", recording.folder, found)
    return found.depth_camera(some[0].intrinsics)


def convert_splats(source: Path, target: Path, overwrite: bool, options: SplatConversion) -> str:
    """Read ``source``, write ``target``, and return a line for the user."""
    from digs_warp.formats.splats.files import SplatWriting
    from digs_warp.pipeline.scene_files import check_target, write_scene_file

    check_target(target)
    check_output_file(target, overwrite, [find_gaussians(source)])
    result = options.read(source)
    if options.made_for is not None:
        result = for_classic(result, source, target, options.for_width)
    names = ("up", "spz_sh_bits", "vertex_colors")
    how = SplatWriting(**{name: getattr(options, name) for name in names})
    write_scene_file(target, result, source, how)
    gaussians = result.gaussians
    size = target.stat().st_size / 1e6
    return f"{target}: {counted(len(gaussians), 'Gaussian')} of degree {gaussians.sh_degree}, {size:.2f} MB"


def for_classic(
    result: "Reconstruction", source: Path, target: Path, width: int | None = None
) -> "Reconstruction":
    """Return a reconstruction for a file that viewers which add 0.3 px^2 show as we do.

    Args:
        result: with the cameras of its recording.
        source: its name in messages.
        target: the file to write.
        width: of the images in which it is looked at [px]; default: that of the recording's.
    """
    from digs_warp.formats.splats.files import SUFFIXES, suffix_of
    from digs_warp.train.smoothing import for_classic_viewers

    if suffix_of(target) not in SUFFIXES:
        raise DigsError(
            f"--for classic: '{target}', expected {', '.join(SUFFIXES)}; what reads other files adds "
            "nothing to splats: leave out --for"
        )
    if result.frames is None or not result.frames.training:
        raise DigsError(
            f"--for classic: '{source}' has splats, but no recording with cameras, and those tell the size "
            "of a pixel; give a folder of 'digs-warp reconstruct' whose capture is still there"
        )
    cameras = [frame.camera for frame in result.frames.training]
    if width is not None:
        sizes = [camera.intrinsics for camera in cameras]
        heights = [max(1, round(k.height * width / k.width)) for k in sizes]
        cameras = [camera.resized(width, h) for camera, h in zip(cameras, heights, strict=True)]
    return replace(result, gaussians=for_classic_viewers(result.gaussians, cameras))
