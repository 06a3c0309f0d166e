"""Record a scene with the stereo camera: mesh and environment in, capture folder out."""

import time
from collections import deque
from collections.abc import Generator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path

from digs_warp.checks import CaptureError, DigsError
from digs_warp.data.capture import Capture, read_capture
from digs_warp.data.capture_writer import CaptureWriter
from digs_warp.data.index_rules import INDEX_NAME
from digs_warp.data.objects import ObjectView
from digs_warp.device.threads import default_threads, limited_threads
from digs_warp.record.files import to_json, write_atomically
from digs_warp.record.layout import RUN_RECORD, SENSOR_PLAN
from digs_warp.record.lock import sole_writer
from digs_warp.record.manifest import Manifest, recorded_files
from digs_warp.record.progress import announced, progress
from digs_warp.record.run_log import RunLog, RunRecord, timed
from digs_warp.sim.config import SimulateConfig as SimulateConfig
from digs_warp.sim.record.frame_maker import FrameMaker, labels_of, layers_of
from digs_warp.sim.record.inputs import load_inputs
from digs_warp.sim.record.object_views import ObjectViews
from digs_warp.sim.record.recorded_facts import (
    facts_about,
    object_record,
    profile_record,
    rig_record,
)
from digs_warp.sim.record.sensor_plan import check_effects, make_plan
from digs_warp.sim.record.session import Session, prepare_session
from digs_warp.words import counted

# Frames that are made at the same time, at most: each takes some tens of megabytes, and beyond this number
# threads wait for the interpreter lock.
AT_ONCE = 8

# The times are saved every SAVE_EVERY frames, in case the run is killed.
SAVE_EVERY = 10


def simulate(
    config: SimulateConfig, folder: Path, resume: bool = False, session: Session | None = None
) -> Capture:
    """Render and sense every frame, and write the capture folder.

    Args:
        config: what to record.
        folder: where to; created when missing.
        resume: go on where a run with the same settings was cut off: complete frames are kept, and the
            result is the same, byte for byte.
        session: already prepared, for settings that differ from ``config`` in tier, effects or strength
            at most; None: prepare one.

    Raises:
        DigsError: bad input, a folder that holds another recording or that another process is writing, or
            settings that differ on resume.
    """
    check_effects(config)
    with sole_writer(folder):
        return _simulate(config, Path(folder), resume, session)


def _simulate(
    config: SimulateConfig, folder: Path, resume: bool, session: Session | None
) -> Capture:
    record = folder / RUN_RECORD
    log = _claim_folder(folder, config, resume)
    if resume and is_finished(folder, config):
        return read_capture(folder)
    with log.stage("load"):
        if session is None:
            prepare = partial(prepare_session, config, load_inputs(config))
        else:
            prepare = partial(replace, session, config=config)
    log.save(record)  # from here on the folder belongs to these settings
    with recorded_files(folder, resume) as manifest, log.saved(record):
        manifest.drop_missing()
        with log.stage("prepare"):
            session = prepare()
        with log.stage("plan"):
            plan = make_plan(session)
        if config.plans_effects:
            drift = plan.drift(session.rig, config.seed, config.strength)
            write_atomically(folder / SENSOR_PLAN, to_json(plan.as_json(drift)).encode())
        writer = CaptureWriter(folder, session.rig.image_intrinsics, rig_record(session.rig))
        _record(FrameMaker(session, plan), writer, log, record)
        capture = writer.finish(facts_about(session, plan))
        log.results = {
            "frames": len(capture),
            "seed": config.seed,
            "object": object_record(session.scene),
            "profile": profile_record(session.profile),
        }
    return capture


def simulate_in_memory(config: SimulateConfig) -> Capture:
    """Render and sense every frame; the capture's pixels are those that `simulate` would write.

    Raises:
        DigsError: bad input.
    """
    maker = FrameMaker.of(config)
    rig = maker.session.rig
    writer = CaptureWriter(None, rig.image_intrinsics, rig_record(rig))
    _record(maker, writer, RunLog("simulate", config), None)
    return writer.finish(facts_about(maker.session, maker.plan))


def _claim_folder(folder: Path, config: SimulateConfig, resume: bool) -> RunLog:
    """Return the log of the recording, with earlier times; refuse a folder that holds another one."""
    log = RunLog("simulate", config)
    record = folder / RUN_RECORD
    if record.exists() and resume:
        log.continue_from(record)
    elif record.exists() or (folder / INDEX_NAME).exists():
        raise DigsError(
            f"capture '{folder}': the folder already holds a recording; resume it if it was cut off, "
            "or choose another folder"
        )
    return log


def is_finished(folder: Path, config: SimulateConfig) -> bool:
    """Whether nothing is left to do for a recording: all its files are there."""
    record = RunRecord.find(folder)
    if record is None or not record.results or not Manifest.read(folder).is_complete():
        return False
    try:
        frames = read_capture(folder).frames
    except CaptureError:  # something was deleted: record it again
        return False
    return all(
        frame.has(layer)
        for number, frame in enumerate(frames)
        for layer in layers_of(config, number)
    )


def frames_at_once() -> int:
    """Return how many frames a recording makes at the same time."""
    return min(AT_ONCE, default_threads())


def _record(maker: FrameMaker, writer: CaptureWriter, log: RunLog, record: Path | None) -> None:
    """Make the frames that are not there yet; ``record`` is the file for the times so far, if any.

    Frames are made side by side: a stage gets the share of the time that passes as it has of the threads'
    time, so that the stages add up to what a user waits for.
    """
    config = maker.session.config
    missing = [
        n for n in range(config.frame_count) if not writer.has_frame(n, layers_of(config, n))
    ]
    done = config.frame_count - len(missing)
    since = time.perf_counter()
    with (
        announced(f"record {counted(len(missing), 'frame')}"),
        progress(config.frame_count, "Recording", "frame", done) as bar,
        closing(_made(maker, missing, writer)) as made,  # after an error no thread goes on writing
    ):
        for count, seconds in enumerate(made, start=1):
            now = time.perf_counter()
            passing = (now - since) / sum(seconds.values())
            since = now
            for stage, spent in seconds.items():
                log.seconds[stage] = log.seconds.get(stage, 0.0) + spent * passing
            if record is not None and count % SAVE_EVERY == 0:
                log.save(record)
            bar.update()
    views = _object_views(maker, log)
    for number, moment in enumerate(maker.session.moments):
        gain = maker.plan.color_gain(moment, config.strength)
        pose = maker.session.walk.pose(moment)
        writer.add_pose(
            *(number, pose, moment),
            color_gain=gain,
            objects=views[number],
            exposure=maker.exposure(number),
        )


def _object_views(maker: FrameMaker, log: RunLog) -> list[tuple[ObjectView, ...]]:
    """Return how the objects appear in each frame; nothing where their numbers are not recorded."""
    config = maker.session.config
    if "instances" not in labels_of(config):
        return [()] * config.frame_count
    with log.stage("objects"):
        views = ObjectViews.of(maker)
        return [views.in_frame(number) for number in range(config.frame_count)]


def _made(
    maker: FrameMaker, numbers: list[int], writer: CaptureWriter
) -> Generator[dict[str, float]]:
    """Make frames; yield the seconds of the stages of each, in order."""
    if not numbers:
        return
    # The first frame runs alone: it compiles kernels, which two threads should not do at once.
    yield _make(maker, numbers[0], writer)
    at_once = frames_at_once()
    if maker.session.config.renderer == "gl":
        at_once = 1  # OpenGL draws in one thread only
    if at_once == 1:
        yield from (_make(maker, number, writer) for number in numbers[1:])
        return
    each = default_threads() // at_once
    pending: deque[Future[dict[str, float]]] = deque()
    with ThreadPoolExecutor(at_once, thread_name_prefix="frame") as pool:
        try:
            for number in numbers[1:]:
                pending.append(pool.submit(_make_within, each, maker, number, writer))
                # Enough that no thread is without work while the first one is waited for.
                if len(pending) > 2 * at_once:
                    yield pending.popleft().result()
            while pending:
                yield pending.popleft().result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _make_within(
    threads: int, maker: FrameMaker, number: int, writer: CaptureWriter
) -> dict[str, float]:
    with limited_threads(threads):
        return _make(maker, number, writer)


def _make(maker: FrameMaker, number: int, writer: CaptureWriter) -> dict[str, float]:
    """Render, sense and write a frame; return the seconds of each stage."""
    seconds: dict[str, float] = {}
    with timed(seconds, "render"):
        frame = maker.render(number)
    images = maker.finish(frame, seconds)
    with timed(seconds, "write"):
        writer.write_frame(number, images)
    return seconds
