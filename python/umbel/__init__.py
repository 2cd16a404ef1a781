"""Umbel: triangle meshes as clusters, acceleration structures and continuous levels of detail.

Every name is imported when it is first used, so `import umbel` itself costs nothing.

    mesh = umbel.load("dragon.ply")
    lod = umbel.build_lod(mesh)
    lod.save("dragon.umbel")

    asset = umbel.Asset("dragon.umbel")
    coarse = asset.mesh(asset.cut(triangles=10_000))
"""

from importlib import import_module


def _listed() -> dict[str, str]:
    """The public names, each with the module that it comes from. __init__.pyi, which editors and
    type checkers read, lists them by lines such as `from .lod.asset import Asset as Asset`."""
    found = {}
    with open(__file__.rpartition(".")[0] + ".pyi", encoding="utf-8") as stub:
        for line in stub:
            if line.startswith("from ."):
                _, module, _, name, *_ = line.split()
                found[name] = f".{name}" if module == "." else module
    return found


_HOME = _listed()

__all__ = sorted(_HOME)


def __getattr__(name: str) -> object:
    if name == "__version__":
        value = import_module("._umbel", __name__).version()
    elif name in _HOME:
        module = import_module(_HOME[name], __name__)
        value = module if _HOME[name] == f".{name}" else getattr(module, name)
    else:
        raise AttributeError(f"module 'umbel' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})
