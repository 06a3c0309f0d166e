"""Results of a reconstruction are read in one place: nobody else opens its files or takes JSON keys."""

import re
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
PACKAGES = ("digs_warp", "sim", "usd", "scripts", "examples")

OWNERS = {
    "digs_warp/record/layout.py",  # the names
    "digs_warp/pipeline/reconstruction.py",
    "digs_warp/pipeline/records.py",
    "digs_warp/pipeline/reconstruct.py",  # resumes from them
    "digs_warp/pipeline/optimize.py",  # takes over a finished training
    "digs_warp/train/session.py",  # writes the course
    "digs_warp/commands/output.py",  # names what --overwrite may delete
}
RECORD_READERS = {
    "digs_warp/pipeline/records.py",
    "digs_warp/data/about.py",  # of a simulated capture
    "digs_warp/data/capture.py",  # says which capture a folder of results belongs to
}
# What only some files may do: the pattern, and the files.
RULES = (
    (r"\b(layout\.)?(EVALUATION|TRAINING)\b", OWNERS),
    (r"read_json\([^\n]*(RUN_RECORD|run\.json|evaluation\.json|training\.jsonl)", OWNERS),
    (r"""\.results(\[["'][^\]]*\](?!\s*=[^=])|\.get\()""", RECORD_READERS),
)


def violations(name: str, source: str) -> list[str]:
    return [
        f"{name}: {match[0]}; take a Reconstruction or a RunRecord"
        for pattern, allowed in RULES
        if name not in allowed
        for match in re.finditer(pattern, source)
    ]


def test_results_are_read_in_one_place() -> None:
    files = [path for package in PACKAGES for path in (REPOSITORY / package).rglob("*.py")]
    assert [
        found
        for path in files
        for found in violations(str(path.relative_to(REPOSITORY)), path.read_text(encoding="utf-8"))
    ] == []


def test_the_rule_itself() -> None:
    for source, allowed in [
        ('read_json(folder / RUN_RECORD, "run record")["seconds"]', False),
        ('read_json(folder / "evaluation.json", "evaluation")["mean"]', False),
        ("from digs_warp.record import layout\n(folder / layout.EVALUATION).is_file()", False),
        ('log.results["scale"]["width"]', False),
        ('record.results.get("sha256")', False),
        ("log.save(folder / RUN_RECORD)", True),
        ('log.results = {"frames": 3}', True),
        ('log.results["frames"] = 3', True),
        ("Reconstruction.load(folder).scores.mean.psnr_frame", True),
    ]:
        assert (violations("digs_warp/commands/x.py", source) == []) == allowed, source
