"""The motion between two frames by their color and depth: where to start, and under which they agree best."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from digs_warp.device.threads import over_items
from digs_warp.poses.agreement import COMPARED, disagreement
from digs_warp.poses.align import align_pair, pyramid_of
from digs_warp.poses.correlation import correlation
from digs_warp.poses.features import Features, Matches, features_of, matched
from digs_warp.poses.information import information
from digs_warp.poses.odometry import odometry
from digs_warp.poses.starts import likely_starts
from digs_warp.poses.views import Picture, View

# The widest images of the search for starts [px]; frames are aligned at the size at which they are compared.
WIDEST_OF_STARTS = 100
# Starts that are tried at a fourth of the size, and the best of them that are followed.
TRIED, FOLLOWED = 6, 2
# Matched features that agree with a motion make up for disagreement: MATCHES of them, or more, for WORTH.
# With MATCHES, no other start is tried.
MATCHES, WORTH = 40, 0.15


@dataclass(frozen=True, eq=False)
class Sight:
    """A frame as its motion is measured.

    Attributes:
        pyramid: views from small ones to at most `COMPARED` columns.
        coarse: the same to at most `WIDEST_OF_STARTS`.
        features: of ``large``.
        large: the frame as it was given.
    """

    pyramid: tuple[View, ...]
    coarse: tuple[View, ...]
    features: Features
    large: Picture

    @property
    def picture(self) -> Picture:
        """At most `COMPARED` columns."""
        return self.pyramid[-1].picture

    @staticmethod
    def of(picture: Picture) -> "Sight":
        """Return a frame at its sizes, with its features."""
        small = picture.at_most(COMPARED)
        coarse = pyramid_of(small.at_most(WIDEST_OF_STARTS))
        return Sight(pyramid_of(small), coarse, features_of(picture), picture)


@dataclass(frozen=True, eq=False)
class Edge:
    """A measured motion between two frames.

    Attributes:
        source: number of the first frame.
        target: number of the second.
        target_from_source: (4, 4), metres.
        information: of the motion, (6, 6), rotation first, as Open3D's pose graphs have it.
        disagreement: of the frames under it, up to 2; see `digs_warp.poses.agreement`; less where features
            match.
        matches: features that match under it.
        correlation: of the frames' details under it; see `digs_warp.poses.correlation`.
    """

    source: int
    target: int
    target_from_source: np.ndarray
    information: np.ndarray
    disagreement: float
    matches: int
    correlation: float


@dataclass(frozen=True, eq=False)
class FramePair:
    """Two frames whose motion is measured.

    Attributes:
        source: number of the first frame.
        target: number of the second.
        first, second: the frames.
        matches: their features.
        by_features: ``target_from_source`` on which most matches agree; None if they are few.
    """

    source: int
    target: int
    first: Sight
    second: Sight
    matches: Matches
    by_features: np.ndarray | None

    @staticmethod
    def of(sights: Sequence[Sight], source: int, target: int) -> "FramePair":
        """Match the features of two frames of a recording; both have depth."""
        first, second = sights[source], sights[target]
        matches = matched(first.features, second.features, second.large.intrinsics)
        return FramePair(source, target, first, second, matches, matches.motion())

    @property
    def is_certain(self) -> bool:
        """Whether enough features match to try no other start."""
        return self.by_features is not None and self.matches.agreeing(self.by_features) >= MATCHES

    def edge(self, before: np.ndarray, search: bool = True) -> Edge:
        """Return the motion under which the frames agree best; see `edge_between`."""
        if self.by_features is not None and self.is_certain:
            starts = [self.by_features]
        else:
            starts = [before] if self.by_features is None else [before, self.by_features]
            starts += self._searched(before) if search else []
        candidates = [
            motion for motions in over_items(starts, self._followed) for motion in motions
        ]
        return min(map(self._edge, candidates), key=lambda edge: edge.disagreement)

    def _searched(self, before: np.ndarray) -> list[np.ndarray]:
        """Return the best motions of a hand or a head, tried in small images."""
        first, second = self.first.coarse, self.second.coarse
        small = first[-1].picture, second[-1].picture
        likely = likely_starts(*small, before, TRIED)
        followed = over_items(likely, lambda motion: align_pair(first, second, motion))
        return sorted(followed, key=lambda motion: self._doubt(*small, motion))[:FOLLOWED]

    def _followed(self, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a start, or what odometry makes of it where few features match, and where it is aligned.

        Both may slide where little holds them.
        """
        first, second = self.first.pyramid, self.second.pyramid
        if not self.is_certain:
            pictures = first[-1].picture, second[-1].picture
            moved = odometry(*pictures, start)
            start = min((start, moved), key=lambda motion: self._doubt(*pictures, motion))
        return start, align_pair(first, second, start)

    def _edge(self, motion: np.ndarray) -> Edge:
        first, second = self.first.pyramid[-1], self.second.pyramid[-1]
        pictures = first.picture, second.picture
        return Edge(
            source=self.source,
            target=self.target,
            target_from_source=motion,
            information=information(first, second, motion),
            disagreement=self._doubt(*pictures, motion),
            matches=self.matches.agreeing(motion),
            correlation=correlation(first, second, motion),
        )

    def _doubt(self, first: Picture, second: Picture, motion: np.ndarray) -> float:
        """Return the disagreement of both frames, less what matched features speak for the motion."""
        agreeing = min(1.0, self.matches.agreeing(motion) / MATCHES)
        return disagreement(first, second, motion) - WORTH * agreeing


def edge_between(
    sights: Sequence[Sight], source: int, target: int, before: np.ndarray, search: bool = True
) -> Edge:
    """Return the motion under which two frames agree best.

    It starts from the motion on which many matched features with depth agree. If they are few, it starts from
    ``before`` as well, and from motions of a hand or a head under which both frames agree best, and odometry
    goes on from there. `align` has the last word; it knows that the noise of depth grows with distance.

    Args:
        sights: of the recording; both frames have depth.
        source: number of a frame.
        target: number of another.
        before: ``target_from_source`` that is likely, (4, 4).
        search: whether to look for other starts.
    """
    return FramePair.of(sights, source, target).edge(before, search)
