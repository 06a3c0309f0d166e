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


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 1.0])
def test_any_mask_comes_back(share: float) -> None:
    mask = np.random.default_rng(1).random((37, 211)) < share
    np.testing.assert_array_equal(mask_of_text(text_of_mask(mask), 37, 211), mask)


@pytest.mark.parametrize("text", ["", FRAMED[:-1], "P", "~", FRAMED + "1"])
def test_text_of_another_mask_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"pixels|character|ends"):
        mask_of_text(text, 40, 70)
