"""OpenUSD comes without type stubs: for the type checker, everything in it may be anything."""

from typing import Any

def __getattr__(name: str) -> Any: ...
