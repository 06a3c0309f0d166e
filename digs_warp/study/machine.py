"""What the figures were measured on."""

import platform
from pathlib import Path

_INFO = Path("/proc/cpuinfo")


def processor() -> str:
    """Return the processor's name and cores, as the system tells them."""
    if not _INFO.is_file():
        return platform.processor() or platform.machine()
    lines = _INFO.read_text(encoding="utf-8").splitlines()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    wide = ", AVX-512" if any("avx512f" in line for line in lines) else ""
    return f"{len(names)} cores of {names[0] if names else platform.machine()}{wide}"
