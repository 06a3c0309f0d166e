"""`digs-warp precompile`: compile all kernels before they are needed, on all cores.

Warp compiles a module on first use, and parses its own headers again for each thread and each set of compiler
options. Here each set has its own process, since LLVM's options hold for a whole process, and one thread in
it, so that the headers are parsed once.
"""

import hashlib
import logging
import os
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from digs_warp.commands.command import Command
from digs_warp.device.threads import default_threads
from digs_warp.record.lock import taking_turns

logger = logging.getLogger("digs_warp.kernels")

PACKAGE = Path(__file__).resolve().parents[1]

# Of the process of a set, which gets the folder of the kernels and the modules of the set.
COMPILE = (
    "import sys; from digs_warp.commands.precompile import compile_in; compile_in(*sys.argv[1:])"
)
QUIETLY: dict[str, Any] = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)


@dataclass(frozen=True)
class Precompile(Command):
    """Compile all kernels for this machine's processor, on all cores; otherwise the first run does it."""

    def execute(self) -> str:
        """Compile what is not compiled yet."""
        import warp as wp

        seconds = compile_kernels()
        done = f"compiled in {seconds:.1f} s" if seconds else "were compiled before"
        return f"{wp.config.kernel_cache_dir}: the kernels {done}"


def compile_kernels() -> float:
    """Compile the kernels of this version that are not yet; return the time that it took [s], or waited.

    A process that fails is not reported: whoever needs its kernels compiles them and tells what is wrong.
    """
    import warp as wp

    from digs_warp.device.warp_start import start_warp

    start_warp()
    sources = _sources_with_warp()
    text = "".join(sources[name] for name in sorted(sources))
    digest = hashlib.blake2b(text.encode(), digest_size=8).hexdigest()
    done = Path(str(wp.config.kernel_cache_dir), f"digs-warp-{digest}")
    if done.exists():
        return 0.0
    start = time.perf_counter()
    with taking_turns(done):
        sets = _sets(sources)
        if sets:
            logger.info("compiling the kernels, once for all runs")
        if _compile_side_by_side(sets):
            done.touch()
    seconds = time.perf_counter() - start
    if sets:
        logger.info("compiled them in %.1f s", seconds)
    return seconds


def compile_in(folder: str, *names: str) -> None:
    """Compile the kernels of modules, in this thread, into a folder of Warp's cache."""
    import warp as wp

    from digs_warp.device.warp_start import start_warp

    start_warp()
    wp.config.kernel_cache_dir = folder
    for name in names:
        for module in _kernel_modules(name):
            wp.load_module(module, device="cpu")


def _sources_with_warp() -> dict[str, str]:
    """Return the package's files with device code, by module; those of linked folders, too."""
    found = {}
    for folder, _, names in os.walk(PACKAGE, followlinks=True):
        for path in (Path(folder, name) for name in names if name.endswith(".py")):
            if "\nimport warp as wp\n" in (source := path.read_text(encoding="utf-8")):
                place = path.relative_to(PACKAGE.parent).with_suffix("")
                found[".".join(place.parts)] = source
    return found


def _kernel_modules(name: str) -> list[Any]:
    """Return what Warp has to compile for a module; kernels made on demand are those that it calls usual."""
    import warp as wp

    usual = getattr(import_module(name), "usual_kernels", None)
    modules = [wp.get_module(name)] if usual is None else [kernel.module for kernel in usual()]
    folder = Path(str(wp.config.kernel_cache_dir))
    # On a CPU, a block is one thread.
    return [
        module
        for module in modules
        if module.kernels and not (folder / module.get_module_identifier(block_dim=1)).exists()
    ]


def _sets(sources: Mapping[str, str]) -> list[list[str]]:
    """Return the modules that are to compile with the same options, the largest set first."""
    sets = defaultdict[tuple[Any, ...], list[str]](list)
    for name in sorted(name for name, text in sources.items() if "@wp.kernel" in text):
        for module in _kernel_modules(name)[:1]:
            options = module.options
            sets[options["cpu_compiler_flags"], options["optimization_level"]].append(name)
    return sorted(sets.values(), key=len, reverse=True)


def _compile_side_by_side(sets: Sequence[Sequence[str]]) -> bool:
    """Compile each set in a process, as many at a time as there are cores; whether all went well."""
    import warp as wp

    begin = [sys.executable, "-c", COMPILE, str(wp.config.kernel_cache_dir)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}

    def run(names: Sequence[str]) -> int:
        return subprocess.run([*begin, *names], env=environment, check=False, **QUIETLY).returncode

    with ThreadPoolExecutor(default_threads()) as pool:
        return not any(pool.map(run, sets))
