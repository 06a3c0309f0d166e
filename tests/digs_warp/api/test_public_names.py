"""The public names: each has one home, and none is also the name of a module."""

import ast
import inspect

import digs_warp


def test_type_checkers_see_the_names_that_are_loaded() -> None:
    tree = ast.parse(inspect.getsource(digs_warp))
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    seen = {
        alias.asname: node.module
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == digs_warp._HOMES


def test_every_public_name_is_there_and_documented() -> None:
    for name in digs_warp.__all__:
        value = getattr(digs_warp, name)
        assert value.__module__ == digs_warp._HOMES[name]
        assert inspect.getdoc(value)
        assert name in dir(digs_warp)
