"""What the device does after matching: a confidence threshold, and filters that users of such cameras know.

All act on what a camera has: disparity, confidence and the left image, never the truth.
"""
