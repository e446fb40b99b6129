"""The types beside the library are those of the library, and everything public is documented."""

import ast
import importlib.util
import inspect
import pathlib

import pytest
import selvedge
from selvedge import _native

STUB = pathlib.Path(selvedge.__file__).parent / "_native.pyi"
TREE = ast.parse(STUB.read_text())
ALL = {node.name: node for node in TREE.body if isinstance(node, ast.ClassDef)}
CLASSES = {name: node for name, node in ALL.items() if not name.startswith("_")}
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


def test_closed_sets_of_words_are_literals():
    """A default that is a word of a closed set stands beside its set; open ones are names and texts."""
    opened = {"name", "training"}
    for node in ast.walk(TREE):
        if not isinstance(node, ast.FunctionDef):
            continue
        ordered = node.args.args
        pairs = list(zip(ordered[len(ordered) - len(node.args.defaults) :], node.args.defaults))
        pairs += zip(node.args.kwonlyargs, node.args.kw_defaults)
        for argument, default in pairs:
            if isinstance(default, ast.Constant) and isinstance(default.value, str):
                is_open = argument.arg in opened or "_Path" in ast.unparse(argument.annotation)
                assert is_open or ast.unparse(argument.annotation) != "str", f"{node.name}: {argument.arg}"


def fields(name):
    return {part.target.id for part in ALL[name].body if isinstance(part, ast.AnnAssign)}


def test_results_have_the_keys_of_their_types(small, model, data, tmp_path):
    run = selvedge.simulate(small, frames=2)
    assert run.compare(run).keys() == fields("_Comparison")
    stepper = selvedge.LearnedStepper(small, model)
    stepper.step()
    assert stepper.trust.keys() == fields("_Trust")
    settings = {"model.latent": 8, "model.blocks": 1, "statistics_samples": 20}
    report = selvedge.train("first", data, tmp_path / "one", steps=1, settings=settings)
    assert report.keys() == fields("_Training")


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


def test_the_types_have_the_documentation_of_the_native_part():
    path = pathlib.Path(__file__).resolve().parents[1] / "stub_docs.py"
    spec = importlib.util.spec_from_file_location("stub_docs", path)
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    text = STUB.read_text()
    assert tool.documented(text) == text, "python stub_docs.py"
    assert all(ast.get_docstring(node) for node in [*CLASSES.values(), *FUNCTIONS.values()])
