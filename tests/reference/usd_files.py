"""What the tests of USD files share: the asset's frame, covariances, programs in fresh processes."""

import os
import subprocess
import sys

import numpy as np

from digs_warp.geometry.rigid import matrix_from_quat_xyzw

SUFFIXES = (".usda", ".usdc", ".usdz")

# Y-up from z-up, written out by hand: x stays, up is y, what came towards the viewer goes to -z.
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def covariances(quats: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """R S^2 R^T of each splat, (n, 3, 3), float64; quaternions xyzw."""
    half = matrix_from_quat_xyzw(quats) * scales[:, None, :].astype(np.float64)
    return half @ half.transpose(0, 2, 1)


def run_fresh(
    program: str, *arguments: object, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run a program in a fresh process that finds the same modules; it has to succeed."""
    done = subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)} | environment,
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done


def error_of_a_full_disk(imports: str, write: str) -> str:
    """Run ``write`` in a fresh process that the system refuses files above 100 kB; return its UsdError."""
    lines = [
        "import resource, signal, sys",
        "from pathlib import Path",
        "from digs_warp.checks import UsdError",
        imports,
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)",
        "resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))",
        "try:",
        f"    {write}",
        "except UsdError as error:",
        "    print(error)",
    ]
    return run_fresh("\n".join(lines)).stdout
