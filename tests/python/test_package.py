"""The package's public names: one list, which editors read and the package follows."""

from __future__ import annotations

import ast
import subprocess
import sys
import types
from pathlib import Path

import pytest

import umbel

STUB = Path(umbel.__file__).with_suffix(".pyi")


def listed() -> dict[str, str]:
    """The public names as a type checker reads them, with the module each is imported from."""
    found = {}
    for node in ast.parse(STUB.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom):
            for name in node.names:
                assert name.asname == name.name, "only `import X as X` makes a name public"
                found[name.name] = node.module or ""
    return found


def test_all_names_the_stub_and_nothing_else() -> None:
    assert umbel.__all__ == sorted(listed())
    assert set(umbel.__all__) <= set(dir(umbel))


@pytest.mark.parametrize("name", sorted(listed()))
def test_each_name_is_what_the_stub_says(name: str) -> None:
    module = listed()[name]
    value = getattr(umbel, name)
    if not module:
        assert isinstance(value, types.ModuleType) and value.__name__ == f"umbel.{name}"
    else:
        assert value is getattr(sys.modules[f"umbel.{module}"], name)
        assert not isinstance(value, types.ModuleType)


def test_what_is_not_there_is_no_attribute() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        umbel.nothing  # type: ignore[attr-defined]  # noqa: B018
    assert not hasattr(umbel, "__path_of_nothing__")
    assert umbel.__version__.count(".") == 2


def test_a_module_below_hides_no_public_name() -> None:
    """Importing `umbel.x` sets the attribute `x` of the package, whatever was there before."""
    below = {path.stem for path in STUB.parent.iterdir() if path.is_dir() or path.suffix == ".py"}
    assert below & set(umbel.__all__) == {name for name, module in listed().items() if not module}


def test_importing_the_package_imports_nothing_else() -> None:
    code = (
        "import sys, umbel; print([m for m in sys.modules if m.startswith('umbel.')], umbel.Mesh)"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.startswith("[] <class 'umbel.geometry.mesh.Mesh'>")
