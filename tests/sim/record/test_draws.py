"""Randomization files, the distributions in them, and draws that depend on (seed, scene, key) alone."""

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from digs_warp.checks import DigsError
from digs_warp.record.fields import parse_json
from digs_warp.record.files import to_json
from digs_warp.record.typed import from_json
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.randomize.draws import SceneJob, draw_scenes, share_of
from digs_warp.sim.record.randomize.randomization import (
    Distribution,
    Randomization,
    entries_of,
    load_randomization,
)
from digs_warp.sim.scene.appearance import LookSettings

SCENES = 4000
CONFIG = SimulateConfig(frames=4, seed=11)


def randomization(**content: Any) -> Randomization:
    return Randomization("mine", entries_of(content, Path(), "mine"))


def one(found: Any, key: str = "strength") -> Distribution:
    return randomization(**{key: found}).entries[key]


def draws(distribution: Distribution, key: str = "light_level") -> list[Any]:
    return [distribution.at(share_of(3, scene, key)) for scene in range(SCENES)]


MINE = randomization(
    light_level={"uniform": [-2, 1]}, strength={"log_uniform": [0.5, 2]}, tint={"uniform": [0, 1]}
)


def draw(mine: Randomization = MINE, count: int = 5) -> tuple[SceneJob, ...]:
    return draw_scenes(mine, CONFIG, count)


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    """Meshes a to h, and two skies."""
    names = [*(f"{letter}.obj" for letter in "abcdefgh"), "day.png", "night.png"]
    for name in names:
        (tmp_path / name).touch()
    return [tmp_path / name for name in names]


@pytest.mark.parametrize(
    ("found", "twin"),
    [
        ({"uniform": [-2, 3]}, stats.uniform(-2, 5)),
        ({"log_uniform": [0.25, 8]}, stats.loguniform(0.25, 8)),
        ({"normal": [1, 0.5], "limits": [0.2, 1.5]}, stats.truncnorm(-1.6, 1.0, 1.0, 0.5)),
        ({"normal": [0, 1], "limits": [7.5, 9]}, stats.truncnorm(7.5, 9)),
        ({"normal": [0, 1], "limits": [-9, -7.5]}, stats.truncnorm(-9, -7.5)),
        ({"normal": [1, 0.25]}, stats.truncnorm(-3, 3, 1, 0.25)),
    ],
)
def test_numbers_follow_the_distribution(found: Any, twin: Any) -> None:
    distribution = one(found)
    shares = np.linspace(0, 1, 200, endpoint=False)
    numbers = [distribution.at(share) for share in shares]
    np.testing.assert_allclose(numbers, twin.ppf(shares), rtol=1e-6, atol=1e-9)
    # And with the shares that scenes have: a spread 1.1 times as wide is noticed.
    values = np.array(draws(distribution))
    assert stats.kstest(values, twin.cdf).pvalue > 1e-3
    assert values.std() == pytest.approx(twin.std(), rel=0.05)
    assert values.mean() == pytest.approx(twin.mean(), abs=0.05 * twin.std())
    low, high = twin.support()
    assert all(
        low - 1e-9 <= distribution.at(share) <= high + 1e-9 for share in (0.0, 1e-300, 1 - 2**-53)
    )


def test_whole_numbers_and_choices_come_as_often_as_the_file_says() -> None:
    dice = one({"uniform": [2, 5]}, "width")
    counts = Counter(draws(dice))
    assert [counts[n] / SCENES for n in (2, 3, 4, 5)] == pytest.approx([0.25] * 4, abs=0.025)
    assert dice.at(1 - 2**-53) == 5
    choice = one({"choice": ["d435", "oak-d", None], "weights": [1, 4, 5]}, "profile")
    counts = Counter(draws(choice))
    shares = [counts[value] / SCENES for value in ("d435", "oak-d", None)]
    assert shares == pytest.approx([0.1, 0.4, 0.5], abs=0.025)
    assert set(draws(one("d435", "profile"))) == {"d435"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("lihgt_level: 1", "unknown key 'lihgt_level'; did you mean 'light_level'"),
        ("seed: 1", "unknown key 'seed'"),
        ("base: outdoor", "base 'outdoor', expected one of indoor"),
        ("light_level: bright", "light_level is 'bright', expected a finite number"),
        ("light_level: true", "light_level is True, expected"),
        ("light_level: .nan", "light_level is nan, expected"),
        ("light_level: [0, 1]", "light_level is [0, 1], expected"),
        ("width: 64.5", "width is 64.5, expected a whole number"),
        ("tier: guidde", "tier is 'guidde', expected one of truth, law, guided"),
        ("environment: skies/*.hdr", "matches 'skies/*.hdr'"),
        ("mesh: 7", "expected the name of a file"),
        ("mesh: nothing.glb", "no such file"),
        ("strength: {unifrom: [0, 1]}", "expected a value, {uniform: [low, high]}"),
        *(
            (f"strength: {wrong}", "strength: found {")
            for wrong in (
                *("{}", "{uniform: 2}", "{uniform: [1, 2, 3]}", "{uniform: [a, b]}"),
                *("{uniform: [2, 1]}", "{uniform: [0, 1], limits: [0, 1]}"),
                *("{log_uniform: [0, 1]}", "{log_uniform: [2, 1]}", "{normal: [1, 0]}"),
                *("{normal: [1, 1], limits: [2, 1]}", "{choice: []}", "{choice: 1}"),
                *("{choice: [1, 2], weights: [1]}", "{choice: [1, 2], weights: [1, 0]}"),
            )
        ),
        ("strength: {choice: [1, x]}", "strength is 'x', expected a finite number"),
        ("width: {uniform: [8, 9.5]}", "width is 9.5, expected a whole number"),
        ("tier: {uniform: [0, 1]}", "tier is 0, expected one of"),
        ("strength: {uniform: [1, 200]}", "strength {uniform: [1, 200]}: --error-strength: 200.0"),
        ("tint: {choice: [[0.1, 2]]}", "tint: 2.0, expected 0 to 1"),
        ("profile: {choice: [d435, d436]}", "did you mean 'd435'"),
        ("effects: flying-pigs", "flying-pigs"),
        ("object_count: 0", "0, expected a whole number, 1 to 255"),
        ("{object_count: {uniform: [1, 2]}, mesh: built-in}", "which stands alone"),
    ],
)
def test_what_is_wrong_is_named_with_file_and_key(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(text if "base" in text or text[0] == "{" else f"base: nothing\n{text}\n")
    with pytest.raises(DigsError) as caught:
        draw_scenes(load_randomization(path), SimulateConfig(), 1)
    message = str(caught.value)
    assert message.startswith("randomization '") and words in message, message


def test_files_are_named_relative_to_the_randomization(files: list[Path]) -> None:
    folder, skies = files[0].parent, [str(path) for path in files[8:]]
    path = folder / "mine.yaml"
    path.write_text("environment: {choice: [built-in, '*.png']}\nmesh: a.obj\nstrength: 0.5\n")
    mine = load_randomization(path).entries
    assert (mine["environment"].values, mine["environment"].shape) == (
        (None, *skies),
        (1.0, 0.5, 0.5),
    )
    assert mine["mesh"].values == (str(files[0]),)
    # The rest is that of the base.
    indoor = load_randomization("indoor").entries
    assert mine == {**indoor, **{key: mine[key] for key in ("environment", "mesh", "strength")}}
    path.write_text("base: wild\n")
    assert load_randomization(path).entries == load_randomization("wild").entries


def test_another_seed_draws_other_scenes_and_more_scenes_leave_the_first_ones_alone() -> None:
    assert draw(count=9)[:5] == draw()
    others = draw_scenes(MINE, replace(CONFIG, seed=12), 5)
    for ours, other in zip(draw(), others, strict=True):
        assert all(ours.drawn[key] != other.drawn[key] for key in ours.drawn)


def test_another_distribution_or_key_changes_no_other_draw() -> None:
    changed = randomization(tint_hue={"uniform": [0, 360]}, strength=3.0).entries
    changed = {**MINE.entries, **changed}
    for before, after in zip(draw(), draw(Randomization("mine", changed)), strict=True):
        assert after.drawn["strength"] == 3.0
        same = {"strength": 0, "tint_hue": 0}
        assert {**after.drawn, **same} == {**before.drawn, **same}


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


def test_settings_in_the_record_are_the_whole_scene_and_given_ones_stay() -> None:
    dark = replace(CONFIG, look=LookSettings(light_level=-3.0), strength=0.25)
    (scene,) = draw_scenes(MINE, dark, 1)
    assert (scene.config.look.light_level, scene.config.strength) == (-3.0, 0.25)
    assert not {"light_level", "strength"} & scene.drawn.keys()
    scenes = draw_scenes(load_randomization("wild"), CONFIG, 200)
    for scene in scenes[:3]:
        record = parse_json(to_json(scene.config))
        assert from_json(SimulateConfig, record, "settings", strict=True) == scene.config
        assert scene.config.seed == scene.drawn["seed"]
        assert scene.config.frames == 4
    seeds = [scene.config.seed for scene in scenes]
    assert len(set(seeds)) == 200
    assert max(seeds) < 2**31 and np.mean(seeds) == pytest.approx(2**30, rel=0.15)


def test_objects_are_different_files_of_the_pool(files: list[Path]) -> None:
    meshes, skies = files[:8], files[8:]
    counted = randomization(object_count={"uniform": [1, 4]}, tint={"uniform": [0, 1]})
    scenes = draw_scenes(counted, CONFIG, 600, meshes, skies)
    assert {scene.config.environment for scene in scenes} == set(skies)
    objects = [list(scene.config.scene) or [scene.config.mesh] for scene in scenes]
    assert {len(each) for each in objects} == {1, 2, 3, 4}
    assert np.mean([len(each) for each in objects]) == pytest.approx(2.5, rel=0.05)
    for chosen, scene in zip(objects, scenes, strict=True):
        assert len(set(chosen)) == len(chosen)
        tints = scene.config.look.tint
        assert len(tints) == len(chosen) == len(set(tints))
        assert "object_count" not in scene.drawn
    names = [path for each in objects for path in each]
    shares = [names.count(path) / len(names) for path in meshes]
    assert shares == pytest.approx([1 / 8] * 8, abs=0.03)
    # The first object is the one that a scene of one would have.
    alone = draw_scenes(randomization(), CONFIG, 50, meshes)
    assert [scene.config.mesh for scene in alone] == [each[0] for each in objects[:50]]
    assert alone[0].drawn["mesh"] == str(alone[0].config.mesh)


def test_objects_that_are_given_stay_and_few_files_repeat(files: list[Path]) -> None:
    mine = randomization(object_count=5, mesh=str(files[0]), tint={"uniform": [0, 1]})
    given = (files[0], files[1])
    (scene,) = draw_scenes(mine, replace(CONFIG, scene=given), 1)
    assert (scene.config.scene, scene.config.mesh) == (given, None)
    assert len(scene.config.look.tint) == 2
    # Without files to choose from, the built-in object stands alone.
    (scene,) = draw_scenes(randomization(object_count=5), CONFIG, 1)
    assert (scene.config.scene, scene.config.mesh) == ((), None)
    (scene,) = draw_scenes(randomization(object_count=3), CONFIG, 1, files[:1])
    assert scene.config.scene == (files[0],) * 3
