"""Figures of the DiGS paper (Meglioraldi et al., J. Imaging 2026, 12, 183) that ours stand beside.

On 200 views of 1600 px per object, 3DGS on a GPU, 12,000 iterations; PSNR in dB by iteration.
"""

# Table 2: mean over both of its data sets.
PSNR: dict[str, dict[int, float]] = {
    "default": {100: 17.553, 500: 23.206, 1000: 24.540, 3000: 25.697, 7000: 26.675, 12000: 27.393},
    "depth": {100: 22.673, 500: 24.376, 1000: 24.901, 3000: 25.848, 7000: 26.764, 12000: 27.519},
    "highdepth": {
        **{100: 23.629, 500: 24.922, 1000: 25.235},
        **{3000: 25.986, 7000: 26.860, 12000: 27.581},
    },
    "fusion": {100: 22.885, 500: 24.711, 1000: 25.130, 3000: 25.963, 7000: 26.811, 12000: 27.552},
    "random": {100: 8.466, 500: 16.542, 1000: 22.088, 3000: 25.207, 7000: 26.563, 12000: 27.392},
}
SSIM: dict[str, dict[int, float]] = {
    "default": {100: 0.9027, 500: 0.9300, 1000: 0.9419, 3000: 0.9525, 7000: 0.9590, 12000: 0.9632},
    "depth": {100: 0.9275, 500: 0.9400, 1000: 0.9450, 3000: 0.9527, 7000: 0.9587, 12000: 0.9626},
    "highdepth": {
        **{100: 0.9363, 500: 0.9462, 1000: 0.9490},
        **{3000: 0.9544, 7000: 0.9602, 12000: 0.9636},
    },
    "fusion": {100: 0.9308, 500: 0.9438, 1000: 0.9477, 3000: 0.9540, 7000: 0.9597, 12000: 0.9633},
    "random": {100: 0.8019, 500: 0.8977, 1000: 0.9229, 3000: 0.9476, 7000: 0.9572, 12000: 0.9617},
}

# Table 3: PSNR of Highdepth less that of Default, on its rendered objects (ShapeNet) and its photographed
# ones (Moschino).
LEAD_SYNTHETIC = {
    **{100: 24.944 - 18.306, 500: 26.395 - 24.279, 1000: 26.764 - 25.876},
    **{3000: 27.698 - 27.295, 7000: 28.769 - 28.488, 12000: 29.650 - 29.356},
}
LEAD_REAL = {
    **{100: 19.243 - 15.045, 500: 20.011 - 19.630, 1000: 20.140 - 20.087},
    **{3000: 20.280 - 20.372, 7000: 20.498 - 20.630, 12000: 20.685 - 20.851},
}

# Table 4 [s]: COLMAP and masks for all, the initialization, 1000 iterations.
PROCESSING_SECONDS = 759
INITIALIZATION_SECONDS = {"default": 0, "depth": 12, "highdepth": 13, "fusion": 13, "random": 0}
SECONDS_TO_1000 = {"default": 27, "depth": 20, "highdepth": 25, "fusion": 22, "random": 48}
