"""Which image pairs to match: neighbors in time, and images that look similar (loops).

COLMAP closes loops with a vocabulary tree, a separate file that has to be downloaded. Here the words
come from the recording itself: a few hundred images need no larger vocabulary.
"""

from collections.abc import Sequence

import numpy as np

from digs_warp.checks import check_shape

WORDS = 64
# Descriptors that the vocabulary is learnt from, in all, and passes over them: about 190 a word.
SAMPLES = 12_000
PASSES = 8


def sequential_pairs(count: int, overlap: int) -> list[tuple[int, int]]:
    """Return pairs i < j of a video: the next ``overlap`` images, and 2, 4, 8, ... images ahead.

    The powers of two, up to 2^overlap, tie distant parts of a slow walk together, as COLMAP does.
    """
    steps = sorted({*range(1, overlap + 1), *(2**power for power in range(overlap + 1))})
    return [(i, i + step) for i in range(count) for step in steps if i + step < count]


def loop_pairs(
    descriptors: Sequence[np.ndarray], per_image: int, min_gap: int, seed: int = 0
) -> list[tuple[int, int]]:
    """Return pairs i < j of the most similar images, without neighbors in time.

    An image is described by its VLAD vector (Jégou et al., "Aggregating local descriptors into a
    compact image representation", CVPR 2010), with intra-normalization (Arandjelović and Zisserman,
    "All about VLAD", CVPR 2013); likeness is the cosine.

    Args:
        descriptors: of each image, shape (features, dimensions); any numeric type.
        per_image: how many partners each image gets, at most.
        min_gap: partners lie at least this many images away.
        seed: of the vocabulary.
    """
    count = len(descriptors)
    if per_image == 0 or sum(len(d) > 0 for d in descriptors) < 2:
        return []
    vectors = vlad(descriptors, learn_words(descriptors, seed))
    likeness = vectors @ vectors.T
    index = np.arange(count)
    likeness[np.abs(index[:, None] - index) < max(1, min_gap)] = -np.inf
    best = np.argsort(-likeness, axis=1, kind="stable")[:, :per_image]
    return sorted(
        {
            (min(i, j), max(i, j))
            for i in range(count)
            for j in best[i].tolist()
            if likeness[i, j] > 0
        }
    )


def learn_words(descriptors: Sequence[np.ndarray], seed: int = 0) -> np.ndarray:
    """Return the centers of k-means on a sample of all descriptors, shape (words, dimensions), float32."""
    from sklearn.cluster import MiniBatchKMeans

    rng = np.random.default_rng(seed)
    each = -(-SAMPLES // max(1, len(descriptors)))
    sample = np.concatenate([d[rng.permutation(len(d))[:each]] for d in descriptors])
    sample = sample.astype(np.float32)
    words = min(WORDS, len(np.unique(sample, axis=0)))
    learnt = MiniBatchKMeans(words, random_state=seed, batch_size=2048, max_iter=PASSES).fit(sample)
    return np.asarray(learnt.cluster_centers_, dtype=np.float32)


def vlad(descriptors: Sequence[np.ndarray], words: np.ndarray) -> np.ndarray:
    """Return the VLAD vector of each image, shape (images, words * dimensions), unit length, float32.

    Per word the differences of its descriptors to it are summed and normalized; an image without
    features gets zeros.
    """
    vectors = np.zeros((len(descriptors), *words.shape), np.float32)
    for number, rows in enumerate(descriptors):
        rows = check_shape("descriptors", rows, (None, words.shape[1])).astype(np.float32)
        # |d - w|^2 without |d|^2, which is the same for all words.
        nearest = np.argmin((words**2).sum(axis=1) - 2.0 * rows @ words.T, axis=1)
        np.add.at(vectors[number], nearest, rows - words[nearest])
    vectors /= np.maximum(np.linalg.norm(vectors, axis=2, keepdims=True), 1e-12)
    flat = vectors.reshape(len(descriptors), -1)
    return flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-12)
