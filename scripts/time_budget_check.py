"""Check --time-budget: trainings end with their budget, and quality does not fall when the budget rises.

    python scripts/time_budget_check.py MESHES WORK --budgets 15 30 60 120

MESHES holds the sample meshes, WORK gets a recording of each object and keeps it for the next run. Run it on
a machine that does nothing else; prints a table and ends with 1 where a training missed its budget by more
than 5 %, or where a longer one lost more than 0.1 dB.
"""

import sys
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import tyro

from digs_warp.api.reconstructions import reconstruct
from digs_warp.data.capture import Capture
from digs_warp.sim.config import SimulateConfig
from digs_warp.sim.record.record import simulate

OBJECTS = ("mustard_bottle", "spot", "avocado", "boot_plain", "armchair", "flight_helmet")
LARGEST_MISS = 0.05  # share of the budget
LARGEST_LOSS = 0.1  # dB: the spread of repeated runs


def say(line: str) -> None:
    """Print a line at once."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


@dataclass
class Check:
    """What is checked."""

    meshes: tyro.conf.Positional[Path]
    work: tyro.conf.Positional[Path]
    objects: tuple[str, ...] = OBJECTS
    budgets: tuple[float, ...] = field(default=(15.0, 30.0, 60.0, 120.0))

    def recording(self, name: str) -> Capture:
        """Return the recording of an object, made if it is not there yet."""
        mesh = next(
            path
            for path in sorted(self.meshes.rglob("*"))
            if name in str(path.relative_to(self.meshes)).lower()
            and path.suffix.lower() in (".obj", ".glb", ".gltf", ".ply")
        )
        return simulate(SimulateConfig(mesh=mesh), self.work / name, resume=True)

    def run(self) -> list[str]:
        """Print a row for each training; return what is wrong."""
        wrong = []
        say("object, budget [s], steps, training [s], PSNR on the object [dB], planned")
        for name in self.objects:
            best, capture = -1e9, self.recording(name)
            for budget in sorted(self.budgets):
                with TemporaryDirectory() as folder:
                    result = reconstruct(capture, Path(folder) / "out", time_budget=budget)
                found, quality = result.training, result.scores.mean.psnr_object
                assert found.training_seconds is not None and found.plan is not None
                row = f"{name}, {budget:g}, {found.iterations}, {found.training_seconds:.1f}"
                say(f"{row}, {quality:.2f}, {found.plan}")
                ended = found.iterations == found.plan.most
                miss = abs(found.training_seconds - budget) / budget
                if miss > LARGEST_MISS and not (ended and found.training_seconds < budget):
                    wrong.append(f"{row}: missed the budget by {miss:.0%}")
                if quality < best - LARGEST_LOSS:
                    wrong.append(f"{row}: {quality:.2f} dB, a shorter budget gave {best:.2f} dB")
                best = max(best, quality)
        return wrong


if __name__ == "__main__":
    sys.exit("\n".join(tyro.cli(Check).run()) or None)
