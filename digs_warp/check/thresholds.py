"""Thresholds of the measures: value, unit, what each was set on (else by hand) and its margin.

The limit of each finding is in its row of `digs_warp.check.findings`. Sizes of work, such as the number of
frames that are compared, are defined in the file that does the work.
"""

# Agreement of frames, in depth as `digs_warp.geometry.reproject` has it: points without which the brightness,
# or nothing at all, is compared; and the standard deviation [of 255] of images that show nothing, where depth
# alone misleads: around an object, inverted poses bring it into agreement.
LEAST_POINTS_FOR_BRIGHTNESS, LEAST_POINTS_IN_COMMON = 50, 200
PLAIN_IMAGE = 2.0

# Exposure: darker and brighter pixels [of 255] are left out, for noise and the end of the range change their
# ratio.
DARKEST, BRIGHTEST = 20, 235

# Wrong units and conventions: an explanation counts if, with it, the frames agree this well and have this
# much in common, and agree better than as recorded by this factor and this difference. Nine simulated
# objects, a real room and a cabinet.
CONVINCING_AGREEMENT, LEAST_OVERLAP = 0.3, 0.25
AGREEMENT_GAIN_FACTOR, AGREEMENT_GAIN_OFFSET = 1.12, 0.03

# Depth of two eyes: one pixel of disparity that is more than this share of the distance tells no shape. An
# armchair of 2.7 m, 320 px: 0.3 to 0.5; objects of 0.5 m, 160 px: 0.15.
COARSE_STEP = 0.2

# Sparse points: in their right place their brightness follows that of the photographs by 0.67 to 0.87, turned
# by 0.2 or, about the vertical, by 0.5. A turn explains it that brings this much, and more than as recorded
# by this factor and difference; below the last one they fit nothing. A simulated object and its scene, a real
# door; margins 1.1 to 4.
POINTS_FIT, POINTS_FIT_FACTOR, POINTS_FIT_MORE, POINTS_MISFIT = 0.4, 1.2, 0.12, 0.15

# Depth against images: a change of place and size counts if it fits better than any other by this [standard
# deviations], and by sizes from this logarithm on. Four recordings whose depth was shifted by 2 to 10 % or
# scaled by 0.85 to 1.15 keep the least certainty from it (1.1 times), six photographs the wrong
# ones; as recorded, 29 simulated objects measure a size of up to 0.05, for stereo widens what is near.
REGISTRATION_CERTAINTY, REGISTRATION_SIZE = 1.5, 0.058

# A mask of fewer pixels marks nothing that could be reconstructed.
LEAST_MASK = 50

# An inverted mask holds this share of the image's border, and leaves out this much of the image.
INVERTED_BORDER, INVERTED_HOLE = 0.75, 0.01

# Moving things: the other frame sees through a point if all that it measures around is farther by this share;
# it shows something else if the pixel is brighter or darker by this [of 255] than all around there. Points at
# steps of depth may hang in the air. Fewer points in common do not make a large share.
SEEN_THROUGH = DEPTH_STEP = 0.1
OTHER_BRIGHTNESS = 20.0
FEWEST_MOVED_POINTS = 500

# Outliers: two frames that look at this much in common can contradict each other; they agree above this share
# of the median agreement of neighbors. Where that is below the last one, single frames are lost in noise.
OUTLIER_OVERLAP, AGREEING_SHARE, LEAST_TYPICAL_AGREEMENT = 0.1, 0.75, 0.4
# Masks that mark fewer points than this between them are not compared.
FEWEST_MARKED = 30

# Repeated frames: thumbnails that differ by less [of 255] show the same.
SAME_THUMBNAIL = 1.0

# A camera that stands still: parts of thumbnails with less contrast [of 255] show nothing; those that
# correlate more show the same (a simulated turntable); fewer parts say nothing; poses that turn by less
# [degree] do not move. Still share: simulated turntables 0.9, moving cameras 0.02.
PLAIN_PART, SAME_PART, FEWEST_PARTS, LEAST_TURN = 3.0, 0.9, 3, 5.0
STILL_SHARE = 0.3
# Of the parts that show something, those that change before a still camera; fewer (0.05 in a hall before a
# robot that stands): all stands still.
LEAST_CHANGE = 0.08
