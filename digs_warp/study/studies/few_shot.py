"""Figures of few-shot methods that ours stand beside.

Novel views of the LLFF scenes from three photographs, PSNR [dB]. FSGS: arXiv 2312.00451; DNGaussian: arXiv
2403.06912; CoR-GS: arXiv 2405.12110.
"""

LLFF_VIEWS = 3
LLFF_PSNR: dict[str, float] = {"DNGaussian": 19.12, "FSGS": 20.43, "CoR-GS": 20.45}
