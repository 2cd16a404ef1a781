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


#: Each imports only what is listed before it, when it is imported itself.
ROOMS = ["errors", "replacing", "plain_json", "geometry", "shapes", "cluster", "accel", "bvh", "io"]
ROOMS += ["lod", "scale", "export", "trace", "viewer", "cuda", "bench", "testing", "cli"]


def imported_rooms(source: Path) -> set[str]:
    """The rooms that a file imports at its top level, not in functions and not for types alone."""
    found = set()
    for node in ast.parse(source.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "umbel":
            below = (node.module or "").split(".")[1:]
            found |= set(below[:1]) if below else {name.name for name in node.names}
    return found - {"_umbel", "_peers"}


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_imports_only_rooms_before_it(room: str) -> None:
    below = STUB.parent / room
    for source in [
        *below.rglob("*.py"),
        *([below.with_suffix(".py")] if not below.is_dir() else []),
    ]:
        allowed = ROOMS[: ROOMS.index(room) + 1]
        assert imported_rooms(source) <= set(allowed), source


def test_every_room_has_its_place() -> None:
    for path in STUB.parent.iterdir():
        if path.suffix == ".py" or (path / "__init__.py").exists():
            assert path.stem in {*ROOMS, "__init__", "__main__"}
