"""Draws depend on (seed, scene, key) alone, and settings say all that a scene needs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.record.fields import parse_json
from digs_warp.record.files import to_json
from digs_warp.record.typed import from_json
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.randomize.distributions import Choice, Span
from digs_warp.sim.record.randomize.draws import SceneJob, draw_scenes, share_of
from digs_warp.sim.record.randomize.settings_file import Randomization, load_randomization
from digs_warp.sim.scene.appearance import LookSettings

CONFIG = SimulateConfig(frames=4, seed=11)
MINE = Randomization(
    "mine",
    {
        "light_level": Span(-2.0, 1.0),
        "strength": Span(0.5, 2.0, "log_uniform"),
        "tint": Span(0.0, 1.0),
    },
)


def draw(mine: Randomization = MINE, count: int = 5) -> tuple[SceneJob, ...]:
    return draw_scenes(mine, CONFIG, count)


def test_the_same_seed_draws_the_same_scenes_and_another_one_others() -> None:
    assert draw() == draw()
    others = draw_scenes(MINE, replace(CONFIG, seed=12), 5)
    for ours, other in zip(draw(), others, strict=True):
        assert all(ours.drawn[key] != other.drawn[key] for key in ours.drawn)


def test_more_scenes_leave_the_first_ones_alone() -> None:
    assert draw(count=9)[:5] == draw(count=5)


def test_another_distribution_or_key_changes_no_other_draw() -> None:
    changed = {"tint_hue": Span(0.0, 360.0), **MINE.entries, "strength": Choice.even(3.0)}
    for before, after in zip(draw(), draw(Randomization("mine", changed)), strict=True):
        assert after.drawn["strength"] == 3.0
        assert {**after.drawn, "strength": 0, "tint_hue": 0} == {
            **before.drawn,
            "strength": 0,
            "tint_hue": 0,
        }


def test_shares_are_even_and_independent() -> None:
    keys = ("light_level", "tint", "tint_hue", "seed")
    shares = np.array([[share_of(0, scene, key) for key in keys] for scene in range(3000)])
    assert 0 <= shares.min() and shares.max() < 1
    histogram = [np.histogram(column, 10, (0, 1))[0] for column in shares.T]
    np.testing.assert_allclose(histogram, 300, atol=75)
    beside = np.column_stack([shares[:-1], shares[1:]])  # the next scene's, too
    correlation = np.corrcoef(beside.T) - np.eye(8)
    assert np.abs(correlation).max() < 0.08
    assert share_of(0, 0, "tint", 0) != share_of(0, 0, "tint", 1)


def test_draws_stay_as_they_were_published() -> None:
    """Data sets of earlier versions can be made again."""
    assert [share_of(7, scene, "mesh") for scene in range(2)] == [
        0.7032359151218377,
        0.452411554893834,
    ]


def test_a_flag_that_is_given_is_not_drawn() -> None:
    dark = replace(CONFIG, look=LookSettings(light_level=-3.0), strength=0.25)
    for scene in draw_scenes(MINE, dark, 3):
        assert (scene.config.look.light_level, scene.config.strength) == (-3.0, 0.25)
        assert not {"light_level", "strength"} & scene.drawn.keys()


def test_meshes_and_environments_are_chosen_among_those_given(tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("a.obj", "b.obj", "day.png", "night.png")]
    for path in files:
        path.touch()
    scenes = draw_scenes(MINE, CONFIG, 40, files[:2], files[2:])
    assert {scene.config.mesh for scene in scenes} == set(files[:2])
    assert {scene.config.environment for scene in scenes} == set(files[2:])
    pairs = {(scene.config.mesh, scene.config.environment) for scene in scenes}
    assert len(pairs) == 4
    assert scenes[0].drawn["mesh"] == str(scenes[0].config.mesh)


def test_settings_in_the_record_are_the_whole_scene() -> None:
    for scene in draw_scenes(load_randomization("wild"), CONFIG, 3):
        record = parse_json(to_json(scene.config))
        assert from_json(SimulateConfig, record, "settings", strict=True) == scene.config
        assert scene.config.seed == scene.drawn["seed"]
        assert scene.config.frames == 4


def test_every_scene_has_a_seed_of_its_own() -> None:
    seeds = [scene.config.seed for scene in draw(count=200)]
    assert len(set(seeds)) == 200
    assert max(seeds) < 2**31 and np.mean(seeds) == pytest.approx(2**30, rel=0.15)


def test_objects_and_distractors_are_different_files_of_the_pool(tmp_path: Path) -> None:
    files = [tmp_path / f"{letter}.obj" for letter in "abcdefgh"]
    for path in files:
        path.touch()
    counted = {
        "object_count": Span(1, 4),
        "distractor_mesh_count": Span(0, 2),
        "tint": Span(0.0, 1.0),
    }
    scenes = draw_scenes(Randomization("mine", counted), CONFIG, 600, files)
    objects = [list(scene.config.scene) or [scene.config.mesh] for scene in scenes]
    others = [scene.config.distractor_meshes for scene in scenes]
    assert {len(each) for each in objects} == {1, 2, 3, 4} and {len(o) for o in others} == {0, 1, 2}
    assert np.mean([len(each) for each in objects]) == pytest.approx(2.5, rel=0.05)
    for chosen, beside, scene in zip(objects, others, scenes, strict=True):
        assert len({*chosen, *beside}) == len(chosen) + len(beside)
        tints = scene.config.look.tint
        assert len(tints) == len(chosen) == len(set(tints))
        assert "object_count" not in scene.drawn
    names = [path for each in objects for path in each]
    shares = [names.count(path) / len(names) for path in files]
    assert shares == pytest.approx([1 / 8] * 8, abs=0.03)
    # The first object is the one that a scene of one would have.
    one = draw_scenes(Randomization("mine", {}), CONFIG, 50, files)
    assert [scene.config.mesh for scene in one] == [each[0] for each in objects[:50]]


def test_more_objects_than_files_repeat_them(tmp_path: Path) -> None:
    (tmp_path / "a.obj").touch()
    (scene,) = draw_scenes(
        Randomization("mine", {"object_count": Choice.even(3)}), CONFIG, 1, [tmp_path / "a.obj"]
    )
    assert scene.config.scene == (tmp_path / "a.obj",) * 3


def test_objects_that_are_given_stay(tmp_path: Path) -> None:
    given = (tmp_path / "a.obj", tmp_path / "b.obj")
    for path in given:
        path.touch()
    entries = {
        "object_count": Choice.even(5),
        "mesh": Choice.even(given[0]),
        "tint": Span(0.0, 1.0),
    }
    mine = Randomization("mine", entries)
    (scene,) = draw_scenes(mine, replace(CONFIG, scene=given), 1)
    assert (scene.config.scene, scene.config.mesh) == (given, None)
    assert len(scene.config.look.tint) == 2
    # Without files to choose from, the built-in object stands alone.
    (scene,) = draw_scenes(Randomization("mine", {"object_count": Choice.even(5)}), CONFIG, 1)
    assert (scene.config.scene, scene.config.mesh) == ((), None)


def test_counts_are_checked() -> None:
    for count, words in ((Choice.even(0), "0, expected 1 to 255"), (Span(1, 2), "built-in")):
        mine = Randomization("mine", {"object_count": count, "mesh": Choice.even(None)})
        with pytest.raises(DigsError, match=rf"mine': object_count.*{words}"):
            draw_scenes(mine, CONFIG, 1)
