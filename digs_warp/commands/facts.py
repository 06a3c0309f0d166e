"""Facts for the terminal: a name and what is known, one per line."""


def format_facts(facts: dict[str, str]) -> str:
    """Return the facts as two aligned columns."""
    width = max(map(len, facts))
    return "\n".join(f"{name.ljust(width)}  {value}" for name, value in facts.items())
