"""Opens networks in ONNX files with onnxruntime, an optional library."""

from pathlib import Path
from typing import Any

from digs_warp.checks import DigsError
from digs_warp.device.libraries import MissingLibraryError


def open_network(path: Path, threads: int, what: str, remedy: str) -> Any:
    """Return an onnxruntime session on the CPU.

    Args:
        path: an ONNX file.
        threads: cores it may use.
        what: of the network, for messages.
        remedy: what to do with a broken file.

    Raises:
        MissingLibraryError: onnxruntime is not installed.
        DigsError: not a network that it can load.
    """
    try:
        import onnxruntime
    except ImportError as error:
        raise MissingLibraryError(
            f"{what}: networks need onnxruntime ({error}): pip install 'digs-warp[masks]'"
        ) from error
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 3  # errors only
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's errors share no base class but Exception
        raise DigsError(
            f"{what} '{path}': not a network that onnxruntime can load ({error}); {remedy}"
        ) from error
