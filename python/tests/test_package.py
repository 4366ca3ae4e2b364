"""The package itself: its stubs, its documentation, its copies."""

import ast
import inspect
import pathlib

import numpy

import xavatar
from xavatar import _native


def public(names):
    return {name for name in names if not name.startswith("_")}


def test_the_stubs_name_what_there_is():
    path = pathlib.Path(xavatar.__file__).with_name("_native.pyi")
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ClassDef):
            stated = {member.name for member in node.body if isinstance(member, ast.FunctionDef)}
            assert public(stated) == public(dir(getattr(_native, node.name))), node.name
        elif isinstance(node, ast.FunctionDef):
            stated = [argument.arg for argument in node.args.args + node.args.kwonlyargs]
            assert stated == list(inspect.signature(getattr(_native, node.name)).parameters), node.name
    stated = {node.name for node in ast.parse(path.read_text()).body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    assert public(stated) == public(dir(_native))


def test_everything_public_is_documented():
    for name in xavatar.__all__:
        member = getattr(xavatar, name)
        if name == "__version__":
            continue
        assert inspect.getdoc(member), name
        if inspect.isclass(member) and member.__module__ == "xavatar":
            for attribute in public(vars(member)):
                assert inspect.getdoc(getattr(member, attribute)), f"{name}.{attribute}"


def test_arrays_own_no_copies(avatar):
    mesh = avatar.canonical(resolution=32)
    for array in (mesh.vertices, mesh.faces, mesh.normals, mesh.colours):
        assert array.base is not None and array.flags.writeable, "the library's memory, handed over"
