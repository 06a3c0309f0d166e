"""Elementary functions that LLVM turns into vector code: no calls, no branches.

`wp.exp` and `wp.log` are calls for one value; `wp.min` and `wp.max` of two variables look for NaN.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})

# ln 2 in two parts: the first has so few digits that its product with an exponent is exact (Cody and Waite).
_LN2_HIGH = wp.constant(0.693359375)
_LN2_LOW = wp.constant(-2.12194440e-4)
_LOG2_E = wp.constant(1.4426950408889634)
# 2^n is a float as long as n is in -126 .. 127.
_EXP_LOWEST = wp.constant(-87.0)
_EXP_HIGHEST = wp.constant(88.0)
_EXPONENT_OF_ONE = wp.constant(127)
_MANTISSA_BITS = wp.constant(23)
# The bits of sqrt(1/2) as a float.
_SQRT_HALF = wp.constant(0x3F3504F3)


@wp.func
def smaller(a: float, b: float) -> float:
    """The smaller of two numbers that are not NaN: one instruction, where `wp.min` looks for NaN."""
    return wp.where(a < b, a, b)


@wp.func
def larger(a: float, b: float) -> float:
    """The larger of two numbers that are not NaN."""
    return wp.where(a > b, a, b)


@wp.func
def exp_of(x: float) -> float:
    """exp(x), relative error below 3e-7; x is held within -87 .. 88; NaN stays NaN.

    exp(x) = 2^n exp(r) with n = round(x / ln 2), |r| <= ln(2) / 2, and Taylor's polynomial of degree 7.
    """
    held = larger(smaller(x, _EXP_HIGHEST), _EXP_LOWEST)
    n = wp.floor(held * _LOG2_E + 0.5)
    r = (held - n * _LN2_HIGH) - n * _LN2_LOW
    rr = r * r
    high = (1.0 / 120.0 + r * (1.0 / 720.0)) + rr * (1.0 / 5040.0)
    low = 0.5 + r * (1.0 / 6.0)
    p = (1.0 + r) + rr * (low + rr * (1.0 / 24.0 + r * high))
    power = wp.cast((int(n) + _EXPONENT_OF_ONE) << _MANTISSA_BITS, wp.float32)
    return wp.where(x == x, p * power, x)


@wp.func
def log_of(x: float) -> float:
    """ln(x) of a positive normal number, relative error below 3e-7.

    ln(2^e m) = e ln 2 + 2 artanh((m - 1) / (m + 1)) with sqrt(1/2) <= m < sqrt(2), as a series.
    """
    bits = wp.cast(x, wp.int32)
    e = (bits - _SQRT_HALF) >> _MANTISSA_BITS
    m = wp.cast(bits - (e << _MANTISSA_BITS), wp.float32)
    s = (m - 1.0) / (m + 1.0)
    ss = s * s
    series = 1.0 + ss * (1.0 / 3.0 + ss * (1.0 / 5.0 + ss * (1.0 / 7.0 + ss * (1.0 / 9.0))))
    return float(e) * (_LN2_HIGH + _LN2_LOW) + 2.0 * s * series


@wp.func
def sigmoid(logit: float) -> float:
    """Opacity of a logit."""
    return 1.0 / (1.0 + exp_of(-logit))
