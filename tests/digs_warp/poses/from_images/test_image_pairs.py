"""Which images are compared."""

import numpy as np

from digs_warp.poses.from_images.image_pairs import (
    loop_pairs,
    sequential_pairs,
    vlad,
)


def test_sequential_pairs_reach_neighbors_and_powers_of_two() -> None:
    pairs = sequential_pairs(100, overlap=5)
    assert {j for i, j in pairs if i == 0} == {1, 2, 3, 4, 5, 8, 16, 32}
    assert {j for i, j in pairs if i == 98} == {99}
    assert len(pairs) == len(set(pairs))


def places(visits: list[int], seed: int = 0) -> list[np.ndarray]:
    """Descriptors of images that show numbered places: those of the same place differ by noise only."""
    rng = np.random.default_rng(seed)
    looks = rng.integers(0, 256, (max(visits) + 1, 60, 128))
    return [
        np.clip(looks[place] + rng.normal(0, 8, (60, 128)), 0, 255).astype(np.uint8)
        for place in visits
    ]


def test_a_walk_that_comes_back_gets_its_loop() -> None:
    visits = [*range(12), *range(12)]  # twice round the same twelve places
    pairs = loop_pairs(places(visits), per_image=1, min_gap=4)
    assert pairs == [(i, i + 12) for i in range(12)]


def test_neighbors_and_images_without_features_get_no_partner() -> None:
    descriptors = places([0, 1, 2, 3, 4, 0])
    descriptors[4] = np.zeros((0, 128), np.uint8)
    pairs = loop_pairs(descriptors, per_image=5, min_gap=3)
    assert all(j - i >= 3 for i, j in pairs)
    assert all(4 not in pair for pair in pairs)
    assert (0, 5) in pairs
    assert loop_pairs(descriptors, per_image=0, min_gap=1) == []
    assert loop_pairs(descriptors[:1], per_image=5, min_gap=1) == []


def test_vlad_is_the_sum_of_differences_to_the_nearest_word() -> None:
    words = np.array([[0.0, 0.0], [10.0, 0.0]], np.float32)
    descriptors = [np.array([[1.0, 0.0], [0.0, 1.0], [10.0, 2.0]])]
    # Word 0 gets (1, 0) + (0, 1), word 1 gets (0, 2); each is normalized, then the whole.
    root = np.sqrt(0.5)
    expected = np.array([root, root, 0.0, 1.0]) * root
    np.testing.assert_allclose(vlad(descriptors, words)[0], expected, atol=1e-6)
