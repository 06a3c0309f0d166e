"""What a validation found: findings, the checks they come from, and a report for people and programs."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from digs_warp.record.files import to_json
from digs_warp.words import counted

Severity = Literal["error", "warning"]
Status = Literal["passed", "failed", "not checked"]


@dataclass(frozen=True)
class Finding:
    """A problem of a scene.

    Attributes:
        rule: name of the rule that found it.
        severity: errors break a reader or a renderer; warnings are probably not intended.
        message: what was found, what was expected.
        where: path of the prim, or name of the layer.
        variants: the choice of variants under which it was found, "" for all.
    """

    rule: str
    severity: Severity
    message: str
    where: str = ""
    variants: str = ""

    def __str__(self) -> str:
        place = " ".join(
            part for part in (self.where, self.variants and f"[{self.variants}]") if part
        )
        return f"{self.severity}: {self.rule}{' at ' if place else ''}{place}: {self.message}"


@dataclass(frozen=True)
class Check:
    """One group of rules and how it ended; what was not run is "not checked", never "passed"."""

    name: str
    status: Status
    note: str = ""


@dataclass(frozen=True)
class Report:
    """The result of a validation.

    Attributes:
        path: the scene.
        checks: the groups of rules.
        findings: errors first.
        combinations: how many combinations of variants were looked at.
    """

    path: Path
    checks: tuple[Check, ...]
    findings: tuple[Finding, ...]
    combinations: int

    def count(self, severity: Severity) -> int:
        """Return the number of findings of a severity."""
        return sum(finding.severity == severity for finding in self.findings)

    @property
    def ok(self) -> bool:
        """Whether no error was found; checks that did not run do not count."""
        return self.count("error") == 0

    def text(self) -> str:
        """Return the report for a terminal."""
        width = max(len(check.name) for check in self.checks)
        lines = [
            f"{check.name.ljust(width)}  {check.status}{f' ({check.note})' if check.note else ''}"
            for check in self.checks
        ]
        lines += [str(finding) for finding in self.findings]
        lines.append(
            f"{self.path}: {counted(self.count('error'), 'error')}, "
            f"{counted(self.count('warning'), 'warning')} in "
            f"{counted(self.combinations, 'combination')} of variants"
        )
        return "\n".join(lines)

    def json(self) -> str:
        """Return the report as JSON: file, ok, checks, findings, combinations."""
        content: dict[str, Any] = {
            "file": self.path,
            "ok": self.ok,
            "checks": [asdict(check) for check in self.checks],
            "findings": [asdict(finding) for finding in self.findings],
            "combinations": self.combinations,
        }
        return to_json(content)
