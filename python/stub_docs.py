"""Gives the types in `_native.pyi` the documentation of the native part, where editors read it:
`python stub_docs.py` writes it, and a test says when it is out of date."""

import ast
import inspect
import pathlib

import selvedge
from selvedge import _native

STUB = pathlib.Path(selvedge.__file__).parent / "_native.pyi"


def parts(body, native, indent=""):
    """Classes and functions with the documentation that they should have."""
    for node in body:
        thing = inspect.getattr_static(native, getattr(node, "name", ""), None)
        if isinstance(node, ast.ClassDef):
            yield from parts(node.body, thing, indent + "    ")
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and not node.name.startswith("__"):
            thing = thing.__func__ if isinstance(thing, staticmethod) else thing
            yield node, inspect.getdoc(thing), indent + "    "


def documented(source):
    """The text of the types with that documentation."""
    lines = source.split("\n")
    found = sorted(parts(ast.parse(source).body, _native), key=lambda part: -part[0].lineno)
    for node, text, indent in found:
        doc = [*f'"""{text}'.split("\n")]
        doc = [(indent + line).rstrip() for line in doc]
        doc = [*doc[:-1], doc[-1] + '"""'] if len(doc[-1]) < 98 else [*doc, indent + '"""']
        first = node.body[0]
        is_only = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
        if is_only:
            # `...`, in the line of the signature or below it, or older documentation.
            start, end = first.lineno - 1, first.end_lineno
            before = lines[start][: first.col_offset].rstrip()
            lines[start:end] = ([before] if before else []) + doc
        else:
            start = min([first.lineno, *(d.lineno for d in getattr(first, "decorator_list", []))]) - 1
            lines[start:start] = doc
    return "\n".join(lines)


if __name__ == "__main__":
    STUB.write_text(documented(STUB.read_text()))
