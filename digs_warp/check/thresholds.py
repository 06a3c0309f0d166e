"""Thresholds of the checks: value, unit, what each was set on, and its margin there.

The limit from which on something is a finding stands in its row of `digs_warp.check.findings`; here are the
thresholds of the measures. Sizes of work, such as how many frames are looked at, stand where the work is
done.
"""


class Threshold(float):
    """A number with its origin.

    Attributes:
        unit: of the value; "1" for shares and factors.
        set_on: what it was set on; "by hand" where nothing was measured.
        margin: how far good recordings, or damaged ones, keep from it there; "" where that is not known.
    """

    unit: str
    set_on: str
    margin: str

    def __new__(
        cls, value: float, unit: str = "1", set_on: str = "by hand", margin: str = ""
    ) -> "Threshold":
        """Return the number."""
        self = super().__new__(cls, value)
        self.unit, self.set_on, self.margin = unit, set_on, margin
        return self


# Agreement of frames, in depth as `digs_warp.geometry.reproject` has it: points without which the brightness,
# or nothing at all, is compared; and the standard deviation of images that show nothing, where depth alone
# misleads: around an object, inverted poses bring it into agreement.
LEAST_POINTS_FOR_BRIGHTNESS = Threshold(50, "points")
LEAST_POINTS_IN_COMMON = Threshold(200, "points")
PLAIN_IMAGE = Threshold(2.0, "of 255")

# Exposure: darker and brighter pixels are left out, for noise and the end of the range change their ratio.
DARKEST = Threshold(20, "of 255")
BRIGHTEST = Threshold(235, "of 255")

# Wrong units and conventions: an explanation counts if, with it, the frames agree this well and have this
# much in common, and agree better than as recorded by this factor and this difference.
CONVINCING_AGREEMENT = Threshold(0.3, set_on="nine simulated objects, a real room and a cabinet")
LEAST_OVERLAP = Threshold(0.25)
AGREEMENT_GAIN_FACTOR = Threshold(1.12, set_on="the same")
AGREEMENT_GAIN_OFFSET = Threshold(0.03, set_on="the same")

# Sparse points: in their right place their brightness follows that of the photographs by 0.67 to 0.87, turned
# by 0.2 or, about the vertical, by 0.5. A turn explains it that brings this much, and more than as recorded
# by this factor and difference; below the last one they fit nothing.
POINTS_FIT = Threshold(0.4, set_on="a simulated object and its scene, a real door")
POINTS_FIT_FACTOR = Threshold(1.2, set_on="the same", margin="1.1")
POINTS_FIT_MORE = Threshold(0.12, set_on="the same", margin="1.4")
POINTS_MISFIT = Threshold(0.15, set_on="the same", margin="4")

# Depth against images: a change of place and size counts if it fits better than any other by this, and by
# sizes from this logarithm on. Four recordings whose depth was shifted by 2 to 10 % or scaled by 0.85 to 1.15
# keep the least certainty from it, six single photographs the largest wrong one.
REGISTRATION_CERTAINTY = Threshold(1.5, "standard deviations", "a room, a cabinet, boxes", "1.1")
REGISTRATION_SIZE = Threshold(0.045, set_on="as recorded, a room measures 0.03", margin="1.5")

# A mask of fewer pixels marks nothing that could be reconstructed.
LEAST_MASK = Threshold(50, "px")

# Outlines of masks: depth bends fully where the second difference of the inverse depth is this share of it
# (zero on a plane in any view, so that the ground does not count); fewer pixels, or outlines, say nothing.
FULL_BEND = Threshold(0.05)
LEAST_OUTLINE_PIXELS = Threshold(20, "px")
LEAST_OUTLINES = Threshold(3, "frames")
LEAST_OUTLINE_OFFSET = Threshold(3, "thumbnail px", "good masks fit best at up to 1", "1.5")
# An inverted mask holds this share of the image's border, and leaves out this much of the image.
INVERTED_BORDER = Threshold(0.75)
INVERTED_HOLE = Threshold(0.01)

# Moving things: the other frame sees through a point if all that it measures around is farther by this share;
# it shows something else if the pixel is brighter or darker by this than all around there. Points at steps of
# depth may hang in the air. Fewer points in common do not make a large share.
SEEN_THROUGH = Threshold(0.1)
DEPTH_STEP = Threshold(0.1)
OTHER_BRIGHTNESS = Threshold(20.0, "of 255")
FEWEST_MOVED_POINTS = Threshold(500, "points")
# A change: across the moment, that many times more points are gone than on the same side of it, for glass,
# gloss and wrong depth hide points on both; frames on each side, and pairs across and on the same side.
CHANGE_FACTOR = Threshold(5.0, set_on="things put beside a simulated object halfway", margin="1.5")
LEAST_FRAMES_BESIDE_CHANGE = Threshold(3, "frames")
LEAST_PAIRS_FOR_CHANGE = Threshold(6, "pairs")

# Outliers: two frames that look at this much in common can contradict each other; they agree above this share
# of the median agreement of neighbors. Where that is below the last one, single frames are lost in noise.
OUTLIER_OVERLAP = Threshold(0.1)
AGREEING_SHARE = Threshold(0.75)
LEAST_TYPICAL_AGREEMENT = Threshold(0.4)

# Repeated frames: thumbnails that differ by less show the same.
SAME_THUMBNAIL = Threshold(1.0, "of 255")

# A camera that stands still: parts of thumbnails with less contrast show nothing; those that correlate more
# show the same; fewer parts, or a smaller share, say nothing; and poses that turn by less do not move.
PLAIN_PART = Threshold(3.0, "of 255")
SAME_PART = Threshold(0.9, set_on="a simulated turntable")
FEWEST_PARTS = Threshold(3, "parts")
STILL_SHARE = Threshold(0.3, set_on="simulated turntables 0.9, moving cameras 0.02", margin="3")
LEAST_TURN = Threshold(5.0, "degrees")
# Of the parts that show something, those that change before a still camera; fewer: all stands still.
LEAST_CHANGE = Threshold(0.08, set_on="a hall before a robot that stands 0.05")

# Blur: images with steps below this at the coarser size show nothing that could be sharp.
PLAIN_STEPS = Threshold(8.0, "of 255")
