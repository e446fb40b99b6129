"""The types beside the library are those of the library, and everything public is documented."""

import ast
import inspect
import pathlib

import pytest
import selvedge
from selvedge import _native

STUB = pathlib.Path(selvedge.__file__).parent / "_native.pyi"
TREE = ast.parse(STUB.read_text())
CLASSES = {node.name: node for node in TREE.body if isinstance(node, ast.ClassDef)}
FUNCTIONS = {node.name: node for node in TREE.body if isinstance(node, ast.FunctionDef)}


def names(things):
    return {name for name in things if not name.startswith("_")}


def parameters(node):
    every = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
    return [argument.arg for argument in every if argument.arg not in ("self", "cls")]


def test_the_types_have_every_name_and_no_other():
    public = names(vars(_native))
    assert public == CLASSES.keys() | FUNCTIONS.keys()
    assert set(selvedge.__all__) - {"__version__", "inspect"} <= public
    for name, node in CLASSES.items():
        kind = getattr(_native, name)
        if not issubclass(kind, Exception):
            typed = {member.name for member in node.body if isinstance(member, ast.FunctionDef)}
            assert names(vars(kind)) == names(typed), name


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_functions_take_what_their_types_say(name):
    found = list(inspect.signature(getattr(_native, name)).parameters)
    assert found == parameters(FUNCTIONS[name])


@pytest.mark.parametrize("name", sorted(CLASSES))
def test_methods_take_what_their_types_say(name):
    kind = getattr(_native, name)
    for node in CLASSES[name].body:
        if not isinstance(node, ast.FunctionDef) or node.name.startswith("__"):
            continue
        decorators = {ast.unparse(d) for d in node.decorator_list}
        if "property" in decorators:
            continue
        found = list(inspect.signature(getattr(kind, node.name)).parameters)
        assert [p for p in found if p != "self"] == parameters(node), node.name


@pytest.mark.parametrize("name", sorted(CLASSES.keys() | FUNCTIONS.keys()))
def test_everything_public_is_documented(name):
    thing = getattr(_native, name)
    assert thing.__doc__, name
    made = [m for m in getattr(CLASSES.get(name), "body", []) if getattr(m, "name", "") == "__new__"]
    # Python shows no documentation of constructors; that of the class has them.
    assert not made or f"`{name}(" in thing.__doc__, name
    for member, value in vars(thing).items() if name in CLASSES else []:
        if not member.startswith("_"):
            assert value.__doc__, f"{name}.{member}"
