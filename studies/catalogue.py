"""The studies of `python -m studies run`, beside those of the package."""

from digs_warp.study.catalogue import Study

MORE_STUDIES = (
    Study(
        "components",
        "What the components are worth",
        "the paper's Highdepth without one component, or with one addition; and what the training knows of "
        "exposure, poses, shutter, blur, rims, depth and gloss: nothing, everything, and all but one part",
        objects=7,
        iterations=300,
        first=("ycb_mustard_bottle", "armchair", "sci_fi_case", "flight_helmet"),
        package="studies",
        command="python -m studies",
    ),
    Study(
        "few-views",
        "Few views",
        "3 to 24 views: a start from the sensor's depth beside sparse and random points, with and without "
        "depth in the loss",
        objects=6,
        iterations=500,
        package="studies",
        command="python -m studies",
    ),
)
