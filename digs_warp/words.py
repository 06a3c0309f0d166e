"""Words of messages: counted things, the first of many names, what a misspelled one may have meant, facts."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches

# Beside a suggestion, more known names than these are not worth reading.
MOST_BESIDE_A_SUGGESTION = 30
LONGEST_QUOTE = 80


def counted(count: int, thing: str, things: str = "") -> str:
    """Return "1 view", "2 views", "1,000 views"; ``things`` is the plural where it is not made with an s."""
    return f"{count:,} {thing if count == 1 else things or f'{thing}s'}"


def first_few(names: Sequence[str], most: int = 5) -> str:
    """Return "a, b, c and 4 more": at most ``most`` of the names."""
    more = f" and {len(names) - most:,} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def quoted(text: str) -> str:
    """Return a name or a line of a file in quotes, as messages show it: not longer than 80 characters."""
    return f"'{cut(text)}'"


def cut(text: str) -> str:
    """Return a text of at most 80 characters, with dots where it was longer."""
    return text if len(text) <= LONGEST_QUOTE else text[: LONGEST_QUOTE - 3] + "..."


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return the end of a message about an unknown word: the nearest known one, and what there is."""
    known = list(known)
    there_is = f"expected one of {', '.join(known)}"
    close = get_close_matches(word, known, n=1)
    if not close:
        return f"; {there_is}"
    more = f" ({there_is})" if len(known) <= MOST_BESIDE_A_SUGGESTION else ""
    return f"; did you mean '{close[0]}'?{more}"


def format_facts(facts: dict[str, str]) -> str:
    """Return the facts as two aligned columns."""
    width = max(map(len, facts))
    return "\n".join(f"{name.ljust(width)}  {value}" for name, value in facts.items())
