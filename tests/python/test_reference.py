"""The Python reference: every public class, function and method shows an example, which the doctests run."""

import inspect
from collections.abc import Iterator
from types import ModuleType

import viscera


def public() -> Iterator[tuple[str, object]]:
    """What `import viscera` offers, and the methods of its classes, by name."""
    for name in viscera.__all__:
        thing = getattr(viscera, name)
        if isinstance(thing, ModuleType):
            yield from of_module(thing)
        elif callable(thing):
            yield name, thing
        if inspect.isclass(thing):
            yield from of_class(thing)


def of_module(module: ModuleType) -> Iterator[tuple[str, object]]:
    for name, function in inspect.getmembers(module, inspect.isfunction):
        if not name.startswith("_") and function.__module__.startswith(module.__name__):
            yield f"{module.__name__}.{name}", function


def of_class(kind: type) -> Iterator[tuple[str, object]]:
    """Methods of a class and of the classes of Viscera that it derives from; properties are read, not called."""
    for name, method in inspect.getmembers(kind, inspect.isroutine):
        if not name.startswith("_") and str(getattr(method, "__module__", None)).startswith("viscera"):
            yield f"{kind.__name__}.{name}", method


def test_every_public_name_shows_an_example() -> None:
    names = dict(public())
    assert {"Organ", "Organ.solve", "load", "viscera.organs.liver"} <= names.keys()
    assert sorted(name for name, thing in names.items() if ">>> " not in (inspect.getdoc(thing) or "")) == []
