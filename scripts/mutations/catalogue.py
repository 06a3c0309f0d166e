"""The faults of `scripts/mutate_sensor.py`, and a plug-in of pytest that puts one into the program.

DIGS_WARP_MUTATION=noise-1.3 python -m pytest -p mutations.catalogue tests/...
"""

import os

import pytest

from mutations import fault as causes
from mutations import wrong_errors as wrong
from mutations.fault import Mutation

VARIABLE = "DIGS_WARP_MUTATION"

GUIDED = "digs_warp.sim.sensor.guided"
COLOR = "digs_warp.sim.sensor.color"
MATCHING = (f"{GUIDED}.tier:sense_by_guided_matching",)
NOISES = tuple(f"{COLOR}.image_noise:{kind}.apply" for kind in ("ShotNoise", "ReadNoise"))
SEARCH = f"{GUIDED}.search"
LAW = "digs_warp.sim.sensor.law"
AFTER = "digs_warp.sim.sensor.effects.disparity_errors"

# Tests that are there for several faults.
NOISE = "test_the_images_have_the_noise_that_the_rig_states"
CORRELATION = "test_neighboring_errors_correlate_as_the_matchers"
PLACES = "test_failures_and_errors_lie_where_the_matchers_do"
AMOUNT = "test_as_much_is_missing_and_the_rest_is_as_far_off"
SIXTEENTHS = "test_disparities_come_in_sixteenths_and_gather_at_whole_pixels"
TWIN = "test_disparity_and_costs_equal_the_twin_to_the_bit"

# The first of these are asked for by name; each of them has to be noticed whatever else changes.
REQUIRED = (
    Mutation("noise-1.3", "image noise x 1.3", NOISE, NOISES, causes.stronger(1.3)),
    Mutation("no-correlation", "small errors change places within squares of 20 px",
             CORRELATION, MATCHING, wrong.disparity(wrong.shuffled_in_squares)),
    Mutation("no-weak-texture", "the truth is found where there is less texture than noise",
             PLACES, MATCHING, wrong.disparity(wrong.right_in_weak_texture)),
    Mutation("strips-doubled", "every run of failures along a row is twice as long",
             "test_failures_are_strips_of_the_same_length",
             MATCHING, wrong.disparity(wrong.strips_doubled)),
    Mutation("no-persistence", "in every frame errors lie elsewhere in their squares of 20 px",
             "test_errors_stay_from_frame_to_frame_as_the_matchers",
             MATCHING, wrong.disparity(wrong.new_in_every_frame)),
    Mutation("holes-as-salt", "as many holes in every square of 20 px, as single pixels",
             "test_holes_are_as_large", MATCHING, wrong.disparity(wrong.salt)),
    Mutation("confidence-label", "confidence 1 for right matches, 0.5 for wrong ones",
             "test_confidence_is_no_label", MATCHING, wrong.confidence(wrong.label)),
)  # fmt: skip

OTHERS = (
    Mutation("noise-0.77", "image noise / 1.3", NOISE, NOISES, causes.stronger(1 / 1.3)),
    Mutation("noise-shared", "the same noise in both eyes",
             "test_noise_is_white_and_independent_between_eyes", NOISES, causes.same_in_both_eyes),
    Mutation("no-noise", "the images without noise are matched",
             PLACES, MATCHING, causes.blind_to_noise),
    Mutation("vignetting-2", "vignetting x 2",
             "test_vignetting_takes_what_the_rig_states_from_the_corners_and_nothing_from_the_middle",
             (f"{COLOR}.vignetting:Vignetting.apply",), causes.stronger(2.0)),
    Mutation("blur-1.3", "the lens spreads points 1.3 times as far",
             "test_the_lens_passes_the_stated_share_of_fine_contrast",
             (f"{COLOR}.vignetting:LensBlur.apply",), causes.stronger(1.3)),
    Mutation("white-errors", "small errors are white noise as strong in every square of 20 px",
             CORRELATION, MATCHING, wrong.disparity(wrong.white)),
    Mutation("errors-1.3", "small errors x 1.3",
             AMOUNT, MATCHING, wrong.disparity(wrong.scaled(1.3))),
    Mutation("errors-0.77", "small errors / 1.3",
             AMOUNT, MATCHING, wrong.disparity(wrong.scaled(1 / 1.3))),
    Mutation("errors-flipped", "small errors have the wrong sign",
             SIXTEENTHS, MATCHING, wrong.disparity(wrong.scaled(-1))),
    Mutation("fewer-wrong", "a quarter of the wrong matches are right",
             "test_as_much_is_wrong_on_the_object_and_around_it",
             MATCHING, wrong.disparity(wrong.fewer_wrong)),
    Mutation("wrong-side", "what one eye cannot see is lost on the other side of the near surface",
             "test_hidden_pixels_and_edges_fail_as_often",
             MATCHING, wrong.disparity(wrong.wrong_side)),
    Mutation("quantum-2", "disparity in eighths of a pixel",
             SIXTEENTHS, MATCHING, wrong.disparity(wrong.eighths)),
    Mutation("confidence-nearness", "confidence falls smoothly with the true error",
             "test_the_same_match_has_the_same_confidence_whatever_is_true",
             MATCHING, wrong.confidence(wrong.nearness)),
    Mutation("confidence-boasts", "the odds of a right match are stated 1.5 times too high",
             "test_confidence_tells_how_often_a_match_is_right",
             MATCHING, wrong.confidence(wrong.boasting)),
    Mutation("not-smooth", "changes of disparity cost nothing",
             TWIN, (f"{SEARCH}:SMALL_STEP", f"{SEARCH}:LARGE_STEP"), causes.value(0)),
    Mutation("not-unique", "matches with equally good rivals are kept",
             AMOUNT, (f"{SEARCH}:search",), causes.with_default(uniqueness=0)),
    Mutation("one-eyed", "matches on which the eyes disagree are kept",
             TWIN, (f"{SEARCH}:_LEFT_RIGHT",), causes.value(10_000)),
    Mutation("islands", "small islands are kept", AMOUNT, (f"{SEARCH}:ISLAND",), causes.value(0)),
    Mutation("own-side-only", "the disparity beyond a depth step is not tried",
             "test_the_blocks_follow_the_rules", (f"{GUIDED}.blocks:STEP_REACH",), causes.value(0)),
    Mutation("near-only", "disparities far from the true one are not tried",
             "test_repeating_texture_adds_the_disparity_that_a_full_search_might_take",
             (f"{SEARCH}:coarse_half_blocks",), causes.nothing_far),
    Mutation("drift-1.3", "the calibration drifts 1.3 times as far",
             "test_the_drift_belongs_to_seed_and_unit_and_has_the_stated_size",
             (f"{COLOR}.rendering:CalibrationDrift.draw",), causes.drifting_farther),
    Mutation("drift-unfollowed", "the search expects matches where the factory calibration has them",
             "test_the_shown_disparity_is_that_of_the_projected_points",
             ("digs_warp.sim.sensor.drift:Drift.shown_disparity",),
             lambda old: lambda self, disparity, k: disparity),
    Mutation("baseline-flipped", "a longer baseline makes depth larger",
             "test_a_changed_baseline_scales_depth",
             ("digs_warp.sim.sensor.drift:Drift.reported_disparity",), causes.baseline_flipped),
    Mutation("device-rough", "the device does not smooth its matches",
             "test_planes_are_as_rough_as_the_devices",
             (f"{AFTER}:Smoothing.apply",), causes.no_effect),
    Mutation("device-trusts", "the device drops no doubtful match",
             "test_holes_are_as_many_and_as_small_as_the_devices",
             (f"{AFTER}:Rejection.apply",), causes.no_effect),
    Mutation("no-speckle", "nothing but the image noise changes from frame to frame",
             "test_speckle_is_what_changes_of_the_noise",
             (f"{AFTER}:Speckle.apply",), causes.no_effect),
    Mutation("speckle-changes", "all speckle is drawn anew in every frame",
             "test_boards_before_the_gemini_are_as_rough_and_change_as_published",
             (f"{AFTER}:lasting_field",), causes.never_lasting),
    Mutation("law-white", "the noise of the tier law is white",
             "test_walls_are_as_rough_in_windows_of_any_size_as_the_devices",
             (f"{LAW}:octave_normal",), causes.white_field),
    Mutation("law-salt", "holes of the tier law are single pixels",
             "test_holes_have_the_number_and_the_sizes_of_the_devices",
             (f"{LAW}:HOLE_CORRELATION",), causes.value(0)),
    Mutation("law-all-changes", "all noise of the tier law is drawn anew in every frame",
             "test_noise_of_the_gemini_changes_and_grows_as_the_devices",
             (f"{LAW}:lasting_field",), causes.never_lasting),
    Mutation("dots-1.3", "the dots of the infrared projector are 1.3 times as bright",
             "test_the_pattern_has_the_density_and_the_distances_of_the_real_one",
             ("digs_warp.sim.sensor.infrared.pair:dot_pattern",), causes.brighter_dots),
)  # fmt: skip

MUTATIONS = REQUIRED + OTHERS


def find_mutation(name: str) -> Mutation:
    """Return the mutation of that name.

    Raises:
        ValueError: there is none.
    """
    by_name = {mutation.name: mutation for mutation in MUTATIONS}
    if name not in by_name:
        raise ValueError(f"mutation '{name}': expected one of {', '.join(by_name)}")
    return by_name[name]


def pytest_configure(config: pytest.Config) -> None:
    """Apply the mutation that the environment names, if any, for the life of the process."""
    if name := os.environ.get(VARIABLE):
        find_mutation(name).apply(pytest.MonkeyPatch())
