"""Masks as COCO's run lengths, against text that pycocotools 2.0 wrote."""

import numpy as np
import pytest

from digs_warp.data.objects import mask_of_text, text_of_mask

# pycocotools.mask.encode of `framed`.
FRAMED = (
    "01d<k0hC00000000000000000000000000000000000000CII77II77II77II77II77II77II77II77II77II7d000"
    "000000000000000000000000000000000000[<"
)


def framed() -> np.ndarray:
    mask = np.zeros((40, 70), bool)
    mask[5:33, 10:60] = True
    mask[20:25, 30:40] = False
    mask[0, 0] = True
    return mask


def test_the_text_is_that_of_coco() -> None:
    assert text_of_mask(framed()) == FRAMED
    np.testing.assert_array_equal(mask_of_text(FRAMED, 40, 70), framed())


def test_any_mask_comes_back_and_text_of_another_is_refused() -> None:
    for share in (0.0, 0.02, 0.5, 1.0):
        mask = np.random.default_rng(1).random((37, 211)) < share
        np.testing.assert_array_equal(mask_of_text(text_of_mask(mask), 37, 211), mask)
    for text in ("", FRAMED[:-1], "P", "~", FRAMED + "1"):
        with pytest.raises(ValueError, match=r"pixels|character|ends"):
            mask_of_text(text, 40, 70)
