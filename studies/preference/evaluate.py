"""Count the preferences in filled answer sheets and test whether they can be chance."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

from digs_warp.checks import DigsError, require_file
from digs_warp.words import counted
from studies.preference.kit import SHEET_COLUMNS

# Below this many expected answers per strategy the chi-square distribution is a poor approximation.
LEAST_EXPECTED = 5.0


@dataclass(frozen=True)
class Answer:
    """The preference of a participant in one question."""

    participant: str
    strategy: str


@dataclass(frozen=True)
class Preference:
    """The result of the evaluation.

    Attributes:
        counts: answers per strategy.
        chi_square, p_value: Pearson's test against equal preference of all strategies.
        pairs: p value of each pair of strategies, from the answers for either of them, with Holm's
            correction for the number of pairs.
        participants: number of people who answered.
    """

    counts: dict[str, int]
    chi_square: float
    p_value: float
    pairs: dict[tuple[str, str], float]
    participants: int

    def text(self) -> str:
        """Return the result as readable lines."""
        total = sum(self.counts.values())
        ranked = sorted(self.counts.items(), key=lambda entry: -entry[1])
        lines = [f"{name:12s} {count:5d}  {100 * count / total:5.1f} %" for name, count in ranked]
        lines.append(
            f"{counted(total, 'answer')} of {counted(self.participants, 'participant')}; equal preference: "
            f"chi-square {self.chi_square:.2f}, {len(self.counts) - 1} degrees of freedom, "
            f"p = {self.p_value:.3g}"
        )
        lines += [f"{a} against {b}: p = {p:.3g}" for (a, b), p in self.pairs.items()]
        if total / len(self.counts) < LEAST_EXPECTED:
            lines.append(
                f"fewer than {LEAST_EXPECTED:g} answers per strategy: too few for this test"
            )
        lines.append(
            "The test assumes independent answers; several of one person are not quite independent."
        )
        return "\n".join(lines)


def read_answers(path: Path, key: dict[tuple[int, int], dict[str, str]]) -> list[Answer]:
    """Read a filled sheet, skipping questions without a choice.

    Args:
        path: CSV with the columns participant, version, question, choice.
        key: strategies by letter for each (version, question).

    Raises:
        DigsError: the file is missing or has the wrong columns, a question that the key does not have, or a
            choice that is not one of its letters.
    """
    try:
        with open(require_file(path, "answers"), newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            missing = set(SHEET_COLUMNS) - set(reader.fieldnames or ())
            rows = list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DigsError(f"answers '{path}': cannot be read ({error})") from error
    if missing:
        raise DigsError(
            f"answers '{path}': no column {', '.join(sorted(missing))}; expected {', '.join(SHEET_COLUMNS)}"
        )
    return [
        answer
        for line, row in enumerate(rows, start=2)
        if (answer := _answer(row, key, f"answers '{path}', line {line}"))
    ]


def _answer(
    row: dict[str, str], key: dict[tuple[int, int], dict[str, str]], where: str
) -> Answer | None:
    choice = (row["choice"] or "").strip().upper()
    if not choice:
        return None
    try:
        places = key[int(row["version"]), int(row["question"])]
    except (KeyError, ValueError, TypeError):
        raise DigsError(
            f"{where}: version {row['version']!r}, question {row['question']!r} is not in the key; use "
            "the key.json of the same kit"
        ) from None
    if choice not in places:
        raise DigsError(f"{where}: choice '{choice}', expected one of {', '.join(places)}")
    return Answer((row["participant"] or "").strip(), places[choice])


def evaluate(answers: Sequence[Answer], strategies: Sequence[str]) -> Preference:
    """Count and test, including strategies that nobody preferred.

    Raises:
        DigsError: no answers, or an answer for a strategy that is not among ``strategies``.
    """
    from scipy.stats import chisquare

    if not answers:
        raise DigsError("preference: no answers; fill the column 'choice' of the sheets")
    counts = dict.fromkeys(strategies, 0)
    for answer in answers:
        if answer.strategy not in counts:
            raise DigsError(
                f"preference: answer for '{answer.strategy}', not in {list(strategies)}"
            )
        counts[answer.strategy] += 1
    test = chisquare(list(counts.values()))
    pairs = {
        pair: float(chisquare([counts[name] for name in pair]).pvalue)
        if any(counts[name] for name in pair)
        else 1.0
        for pair in combinations(strategies, 2)
    }
    people = len({answer.participant for answer in answers})
    return Preference(counts, float(test.statistic), float(test.pvalue), _holm(pairs), people)


def _holm(pairs: dict[tuple[str, str], float]) -> dict[tuple[str, str], float]:
    """Return p values corrected for their number (Holm 1979: step down)."""
    corrected: dict[tuple[str, str], float] = {}
    largest = 0.0
    ranked = sorted(pairs, key=pairs.__getitem__)
    for rank, pair in enumerate(ranked):
        largest = max(largest, min(1.0, (len(ranked) - rank) * pairs[pair]))
        corrected[pair] = largest
    return {pair: corrected[pair] for pair in pairs}
