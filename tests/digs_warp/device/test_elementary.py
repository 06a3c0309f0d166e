"""Exponential and logarithm in vector code, against float64."""

import numpy as np
import warp as wp

from digs_warp.device.elementary import exp_of, log_of, sigmoid

# Twice the rounding error of float32.
RELATIVE = 2.5e-7


@wp.kernel
def evaluate_kernel(
    values: wp.array[float],
    exps: wp.array[float],
    logs: wp.array[float],
    opacities: wp.array[float],
) -> None:
    i = wp.tid()
    exps[i] = exp_of(values[i])  # pyright: ignore
    logs[i] = log_of(values[i])  # pyright: ignore
    opacities[i] = sigmoid(values[i])  # pyright: ignore


def evaluate(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    inputs = wp.array(values, dtype=float, device="cpu")
    outputs = [wp.zeros_like(inputs) for _ in range(3)]
    wp.launch(evaluate_kernel, dim=len(values), inputs=[inputs], outputs=outputs, device="cpu")
    exps, logs, opacities = (output.numpy() for output in outputs)
    return exps, logs, opacities


def test_exponentials_are_exact_to_float32() -> None:
    values = np.linspace(-86.9, 87.9, 200_001).astype(np.float32)
    exps, _, opacities = evaluate(values)
    exact = np.exp(values.astype(np.float64))
    np.testing.assert_allclose(exps, exact, rtol=RELATIVE)
    np.testing.assert_allclose(opacities, exact / (1.0 + exact), rtol=2.0 * RELATIVE, atol=1e-37)


def test_exponentials_outside_of_the_range_stay_at_its_ends_and_nan_stays_nan() -> None:
    exps, _, _ = evaluate(np.array([-1e30, -200.0, 200.0, np.inf, np.nan, 0.0], dtype=np.float32))
    low, high = np.exp(-87.0), np.exp(88.0)
    np.testing.assert_allclose(exps, [low, low, high, high, np.nan, 1.0], rtol=RELATIVE)


def test_logarithms_are_exact_to_float32() -> None:
    near_one = 1.0 + np.linspace(-1e-3, 1e-3, 20_001)
    values = np.concatenate([np.geomspace(1e-37, 1e38, 200_001), near_one]).astype(np.float32)
    _, logs, _ = evaluate(values)
    np.testing.assert_allclose(logs, np.log(values.astype(np.float64)), rtol=2.0 * RELATIVE)
