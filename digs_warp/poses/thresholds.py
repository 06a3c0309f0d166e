"""All thresholds by which poses are accepted, refused or measured again, in one table.

Each row: unit | what it was set on | its margin there. "by hand": nothing else is known of it. How much depth
may differ on one surface says `digs_warp.geometry.reproject`; numbers of steps, samples and sizes, which only
trade time for accuracy, stay with their algorithms.
"""

# --- Structure from motion (from_images/)

# images of a recording and of a model | by hand: COLMAP's own limit of 10 would refuse small sets
MIN_IMAGES = 3
# images up to which all pairs are matched | time: matching them all costs less than a wrong loop
MAX_IMAGES_EXHAUSTIVE = 40
# px, longest side up to which images are enlarged twice | time: half of it, in larger ones
MAX_SIDE_ENLARGED = 1000
# features on half of the images, below which texture is named as the cause | by hand
MIN_FEATURES = 50
# share of matched pairs that a homography explains: a turning camera or one flat wall | by hand
MAX_PLANAR_SHARE = 0.8
# motion of the camera over the distance of what it sees; below, nearly all image motion is its turn | by hand
MIN_MOTION = 0.01
# second over first extent of the path of the camera, below which it is a straight line | by hand
MIN_PATH_WIDTH = 0.01
# points per image with given poses, below which poses and images have nothing in common | by hand
MIN_OBSERVATIONS = 10

# px, median error of a printed board's points, above which it is another board | by hand
MAX_BOARD_ERROR = 3.0

# share of the distance, and degree, between poses and the nearest turn about one axis, beyond which an object
# was not on a turntable | a simulated one: 0.003 and 0.2 | 5
MAX_OFF_AXIS, MAX_OFF_AXIS_DEG = 0.02, 1.0

# --- Matched features (features.py)

# nearest over second nearest descriptor | Lowe, IJCV 2004, has 0.8; white rooms need more matches
MAX_DESCRIPTOR_RATIO = 0.85
# px, reprojection error of an inlier | by hand
MAX_REPROJECTION_ERROR = 3.0
# inliers, below which a motion is not tried | by hand
MIN_INLIERS = 10

# --- Matched photographs (photo_matches.py)

# matches of two photographs, below which they prove nothing | by hand
LEAST_MATCHES = 30
# share of matches within this of the epipolar lines of right poses | an arc of 12 frames, a real room | 1.3
USUAL_MATCH_SHARE = 0.6

# --- Covisibility and correlation of two frames (agreement.py)

# degree between two views of a point, from which on pictures are too different | by hand
MAX_VIEW_ANGLE = 54.0
# share of a frame's points that another one sees, below which they are no pair | by hand
MIN_COVISIBILITY = 0.05
# points on the same surface, and share of a frame's points, below which nothing is correlated | by hand
MIN_CORRELATED, MIN_CORRELATED_SHARE = 100, 0.05

# --- Odometry (from_depth/)

# disagreement of a frame and the next | right steps of 3 to 48 degrees: 0.3 to 1.2, most where the exposure
# changes and depth is missing | none: such steps hold by their inliers or their correlation
MAX_STEP_DISAGREEMENT = 1.1
# inliers with which a step holds all the same | wrong motions: up to 20 | 10
MIN_STEP_INLIERS = 30
# correlation with which a step holds all the same | right motions of a room of changing exposure: 0.76 and
# more, wrong ones that do not hold otherwise: up to 0.4, opposite sides of a cabinet: 0.58 | 0.07 and 0.11; a
# texture that repeats has more, as it has inliers
MIN_STEP_CORRELATION = 0.65
# inliers with which no other start is tried | by hand
MIN_CERTAIN_INLIERS = 40

# --- Pose graph (from_depth/)

# degree, median residual of the loop edges | good recordings: 0.1 to 0.5, wrong edges: 1.2 and more | 0.2
MAX_RESIDUAL_DEG = 1.0
# degree, from which on loop edges are measured again from the poses | the same | 0
MAX_SETTLED_RESIDUAL_DEG = 0.5
# line process weight below which Open3D prunes an edge, 0 to 1 | Open3D's default
MIN_EDGE_WEIGHT = 0.25

# --- Do color and depth contradict poses from images? (from_depth/estimate.py)

# degree between the pose and what depth measures | noise of depth: below | by hand
MIN_OTHER_TURN_DEG = 2.0
# drop of the disagreement under the measured motion | noise of small images: below | by hand
MIN_DISAGREEMENT_DROP = 0.05
# share of contradicted steps, above which poses are doubtful | by hand
MAX_CONTRADICTED_SHARE = 0.1

# --- Refined poses (refine/)

# minimum relative drop in alignment error to accept refined poses | exact poses: up to 0.13, by fitting the
# noise of depth; poses off by 0.1 degrees and 1 mm: as much or more, and no worse for it; a room: 0.146 in
# 270 columns, 0.158 in 540 | 0.006
MIN_ALIGNMENT_GAIN = 0.14
# px and share of the longer side, mean distance of matched features from where given poses put them; above
# both, cameras move in training without depth | right poses: 0.0005, in noise 0.41 px; off by 0.1 degrees,
# or a HoloLens's: 0.0015 and more | 0.1 px, 0.0005
MAX_MISFIT_PX, MAX_MISFIT = 0.5, 0.001
# below one pixel, depth noise dominates: disagreement of a frame with its new pose over that with the old one
# from which on it keeps the old one, where the drop is below the row above | by hand
MIN_DISAGREEMENT_RATIO = 1.03
# degree, root mean square turn: more, and the poses were not nearly right | by hand
MAX_REFINED_TURN_DEG = 5.0
# disagreement after the bundle adjustment over that before | five simulated objects: 0.99 to 1.004, with far
# better poses; a room by time of flight: 1.016, a cabinet without texture: 1.08, with worse ones | 0.006
MAX_ADJUSTED_RATIO = 1.01

# --- Frames that all others contradict (refine/refine.py; set on the avocado and on spot)

# frames with depth, below which none is an outlier | by hand
MIN_COMPARED_FRAMES = 5
# share of outlier frames, above which nothing tells which are right | by hand
MAX_OUTLIER_SHARE = 0.25
# disagreement above the median of all frames | avocado, spot
MIN_OUTLIER_DISAGREEMENT = 0.15
# standard deviations (robust) above the median | avocado, spot: right frames reach 3 | 1
MIN_OUTLIER_DEVIATIONS = 4.0
# correlation over the usual one, from which on a frame of another exposure is in its place | avocado, spot
MIN_ALIKE = 0.6
