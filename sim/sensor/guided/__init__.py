"""The 'guided' tier: semi-global matching of the two recorded images, in a band round the true disparity.

A full search compares 50 to 450 disparities per pixel. The truth is known, so 32 are enough: those round the
pixel's own disparity, of a second surface behind glass or in a mirror, of the other side where a depth step
is near, and those that a coarse full search prefers; 16 where texture is strong and there is none of these.
Costs, penalties and checks are OpenCV's StereoSGBM (Hirschmueller 2008; Birchfield and Tomasi 1998), so
errors of texture, blur, noise, edges and occlusion arise where the full search has them.
"""
