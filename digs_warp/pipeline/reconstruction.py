"""The result of a reconstruction, in memory and in the folder of docs/formats.md.

No other code reads or names the files of that folder that describe a result, but `records` beside it.
"""

from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.gaussians import CARDS, OTHER_FORMATS, Gaussians
from digs_warp.data.images import read_image
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.posed_frames import PosedFrames
from digs_warp.geometry.camera import Camera
from digs_warp.init.start import Start
from digs_warp.measure.scores import Scores
from digs_warp.pipeline.records import (
    RENDERS,
    Poses,
    Verdict,
    find_frames,
    read_scores,
    store,
    stored,
    stored_capture,
)
from digs_warp.record.fields import Fields
from digs_warp.record.files import copy_folder, to_json, write_atomically
from digs_warp.record.layout import (
    COURSE,
    EVALUATION,
    GAUSSIANS,
    INITIAL_POINTS,
    MASKS,
    RUN_RECORD,
    TRAINING,
    find_gaussians,
)
from digs_warp.record.results import figures
from digs_warp.record.run_log import RunRecord
from digs_warp.train.training import CourseRow, Training, load_snapshots, read_course, write_course
from digs_warp.words import counted

if TYPE_CHECKING:
    from digs_warp.splat.render import RenderOutput


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Reconstruction:
    """Gaussians, and what is known of how they were made.

    A finished reconstruction has everything; for Gaussians from elsewhere only the Gaussians are known.

    Attributes:
        gaussians: the result, in metres unless ``poses.metric_scale`` says otherwise.
        poses: the frames with the cameras and masks that were used, where these were not stored those of the
            capture, and where their poses come from.
        start: the points that the training started from, and where they come from.
        training: loss and quality along the training, and what it decided.
        scores: how well the held-out views match, and how far the surface is from the true one.
        verdict: whether it is good, why, and what to do.
        run: settings, versions and machine, and the seconds of each stage.
        folder: where it is stored.
        capture: folder of the recording; None if it is not known, or only in memory.
    """

    gaussians: Gaussians
    poses: Poses = field(default_factory=Poses)
    start: Start | None = None
    training: Training = field(default_factory=Training)
    scores: Scores = field(default_factory=Scores)
    verdict: Verdict = field(default_factory=Verdict)
    run: RunRecord = field(default_factory=lambda: RunRecord("", {}, {}))
    folder: Path | None = None
    capture: Path | None = None

    def __repr__(self) -> str:
        where = "in memory" if self.folder is None else f"'{self.folder}'"
        known = f", {self.quality}" if self.scores.views else ""
        return f"<reconstruction {where}: {counted(len(self.gaussians), 'Gaussian')}{known}>"

    def _repr_html_(self) -> str:
        return import_module(CARDS).reconstruction_card(self)

    @property
    def frames(self) -> PosedFrames | None:
        """Training and held-out views; None where the capture is not known."""
        return self.poses.frames

    @property
    def course(self) -> tuple[CourseRow, ...]:
        """Loss and quality along the training, a row every few iterations."""
        return self.training.course

    @property
    def settings(self) -> dict[str, Any]:
        """The settings as JSON values; empty where they are not known."""
        return self.run.settings

    @property
    def seconds(self) -> dict[str, float]:
        """Wall-clock time of each stage [s]."""
        return self.run.seconds

    @property
    def strategy(self) -> str | None:
        """How the initial points were made, such as "highdepth"; None where it is not known."""
        used = self.start.strategy if self.start else None
        return used or self._setting("init", "strategy")

    @property
    def masks(self) -> str | None:
        """Where the masks came from: "capture", or how they were made; None where it is not known."""
        return self._setting("segment", "masks")

    @property
    def instance(self) -> int | None:
        """The number of the one object that was reconstructed, of several; None: all of them."""
        segment = Fields(self.settings, "settings").section("segment", optional=True)
        return segment.whole("instance", default=None)

    @property
    def quality(self) -> str:
        """How well the held-out views match, in a phrase that names what was compared."""
        return self.scores.words(has_object=self.poses.subject == "object")

    @property
    def figures(self) -> dict[str, dict[str, str]]:
        """All results in words: for each stage, names and values."""
        return {name: figures(record) for name, record in self._stages().items()}

    @property
    def results(self) -> dict[str, Any]:
        """The results as run.json holds them."""
        return store(self.capture, **self._stages())

    def _stages(self) -> dict[str, Any]:
        """Return the records of the stages that are done."""
        stages = {"poses": self.poses, "start": self.start, "training": self.training}
        done = bool(self.scores.views)
        stages |= {"scores": self.scores, "verdict": self.verdict} if done else {}
        return {name: record for name, record in stages.items() if record is not None}

    def render(self, camera: Camera, **settings: Any) -> "RenderOutput":
        """Return a view of the Gaussians; the settings are those of `digs_warp.splat.render.render`."""
        from digs_warp.splat.render import render

        return render(self.gaussians, camera, **settings)

    def save_usd(self, path: Path | str, capture: Capture | None = None) -> None:
        """Write a USD scene.

        Args:
            path: the file; its suffix decides: .usdz (package), .usdc (binary), .usda (text).
            capture: the recording: its cameras and meshes go into the scene (.usdz only).

        Raises:
            DigsError: another suffix, or the scene cannot be written.
        """
        from digs_warp.pipeline.usd_scene import write_capture_package
        from digs_warp.usd.writer import write_gaussians

        if capture is None:
            write_gaussians(Path(path), self.gaussians, self.scene_metadata)
        else:
            write_capture_package(capture, self, Path(path))

    @property
    def scene_metadata(self) -> dict[str, Any]:
        """What a USD scene says about the making."""
        from digs_warp.pipeline.usd_scene import scene_metadata

        return scene_metadata(self.gaussians, self.run, self.poses, self.scores)

    def in_memory(self) -> "Reconstruction":
        """Return the reconstruction without its folder; masks that were made for it are loaded.

        Renders of held-out views and training snapshots are not included.
        """
        frames = self.frames
        if frames and self.folder:
            frames = frames.with_masks_loaded(self.folder)
        return replace(self, poses=replace(self.poses, frames=frames), folder=None)

    def load_render(self, name: str, shape: tuple[int, ...]) -> np.ndarray:
        """Return a held-out view as the Gaussians show it on white, sRGB, uint8.

        Args:
            name: of the frame.
            shape: of its photograph, (height, width, 3).

        Raises:
            DigsError: it was not stored, or has another size.
        """
        if self.folder is None:
            raise DigsError("reconstruction: it is only in memory; save it to a folder first")
        path = self.folder / RENDERS / f"{name}.png"
        pixels = read_image(path, "rendered view")
        if pixels.dtype != np.uint8 or pixels.shape != shape:
            raise DigsError(
                f"rendered view '{path}': {pixels.shape} of {pixels.dtype}, expected {shape} of uint8 as the "
                "capture has; reconstruct again"
            )
        return pixels

    def load_snapshots(self) -> tuple[tuple[int, Gaussians], ...]:
        """Return (iteration, Gaussians) of the training, ascending; empty where none were kept.

        Raises:
            DigsError: a file is broken.
        """
        return load_snapshots(self.folder) if self.folder else ()

    def save(self, path: Path | str) -> "Reconstruction":
        """Write the splats into a file, by its suffix, or all into a folder that `load` reads.

            result.save("scene.usdz"); result.save("scene.ply"); result.save("out/result")

        Renders, snapshots and masks of the folder that it was loaded from are copied.

        Returns:
            The reconstruction, with a folder that was written as its folder.

        Raises:
            DigsError: another suffix, or the file or folder cannot be written.
        """
        folder = Path(path)
        if folder.suffix and not folder.is_dir():
            import_module(OTHER_FORMATS).save_file(folder, self)
            return self
        frames = self.frames
        if self.folder is not None and self.folder.resolve() != folder.resolve():
            for name in (RENDERS, COURSE, MASKS):
                if (self.folder / name).is_dir():
                    copy_folder(self.folder / name, folder / name)
            frames = frames.moved(self.folder, folder) if frames else None
        if frames:
            frames.save(folder)
        if self.start:
            self.start.points.save(folder / INITIAL_POINTS)
        write_course(folder / TRAINING, self.course)
        write_atomically(folder / EVALUATION, to_json(self.scores.to_json()).encode())
        run = replace(self.run, results=self.results)
        run.save(folder / RUN_RECORD)
        self.gaussians.save(folder / GAUSSIANS)
        return replace(self, folder=folder, poses=replace(self.poses, frames=frames), run=run)

    @staticmethod
    def load(
        folder: Path, capture: Capture | None = None, partial: bool = False
    ) -> "Reconstruction":
        """Read the folder of a reconstruction, or of a whole run.

        Args:
            folder: of 'digs-warp reconstruct' or 'digs-warp run', or its gaussians.npz.
            capture: the recording; without it, the one that was reconstructed, if it is still there.
            partial: accept an unfinished folder if it has Gaussians; missing parts are None.

        Raises:
            DigsError: a file is missing or broken; the message names it.
        """
        if not Path(folder).exists():
            raise DigsError(f"reconstruction '{folder}': no such folder")
        folder = find_gaussians(Path(folder)).parent
        gaussians = Gaussians.load(folder / GAUSSIANS)

        def wanted(name: str) -> bool:
            return not partial or (folder / name).is_file()

        scores = read_scores(folder / EVALUATION) if wanted(EVALUATION) else Scores()
        course = read_course(folder / TRAINING) if wanted(TRAINING) else ()
        run = RunRecord.load(folder / RUN_RECORD) if not partial else RunRecord.find(folder)
        points = folder / INITIAL_POINTS
        frames, place = find_frames(folder, capture, stored_capture(run, folder))
        start = None
        if points.is_file():
            start = stored(Start, run, folder, points=PointCloud.load(points))
        measured = stored(Scores, run, folder)
        return Reconstruction(
            gaussians=gaussians,
            poses=stored(Poses, run, folder, frames=frames),
            start=start,
            training=stored(Training, run, folder, course=course),
            verdict=stored(Verdict, run, folder),
            scores=replace(measured, views=scores.views, mean=scores.mean),
            run=run or RunRecord("", {}, {}),
            folder=folder,
            capture=place,
        )

    @staticmethod
    def of_gaussians(
        gaussians: Gaussians, folder: Path, capture: Capture | None = None
    ) -> "Reconstruction":
        """Return Gaussians that another program wrote into ``folder``, with the views of a capture.

        Without ``capture``, it is the one that a run left in or beside the folder, if any.
        """
        frames, place = find_frames(folder, capture)
        if gaussians.world_offset is not None and frames is not None:
            recorded = capture or read_capture(place or folder)
            gaussians = gaussians.less(recorded.about.world_offset)
        return Reconstruction(gaussians=gaussians, poses=Poses(frames=frames), capture=place)

    def _setting(self, group: str, name: str) -> str | None:
        return Fields(self.settings, "settings").section(group, optional=True).text(name, None)
