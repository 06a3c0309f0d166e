"""Facts for the terminal: a name and what is known, one per line."""

Facts = dict[str, str]


def format_facts(facts: Facts) -> str:
    """Return the facts as two aligned columns."""
    width = max(map(len, facts))
    return "\n".join(f"{name.ljust(width)}  {value}" for name, value in facts.items())
