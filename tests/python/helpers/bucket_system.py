"""A file system like those of object stores other than S3 (gcsfs, adlfs), without a server: whole
objects alone, no folders, no appending and no renaming; lists are kept until the cache is cleared;
a file that is there already is written over also where only a new one is wanted; a name that is not
there cannot be removed; paths have no leading slash, and no entity tags."""

from __future__ import annotations

from typing import Any, ClassVar

from fsspec import AbstractFileSystem


class BucketSystem(AbstractFileSystem):  # type: ignore[misc]  # fsspec says no types
    protocol = "bucket"
    root_marker = ""
    store: ClassVar[dict[str, bytes]] = {}

    def _list(self, path: str) -> list[dict[str, Any]]:
        """All below a name, as it was when it was first asked for."""
        if path not in self.dircache:
            begin = path.rstrip("/") + "/"
            self.dircache[path] = [
                {"name": name, "size": len(data), "type": "file"}
                for name, data in sorted(self.store.items())
                if name.startswith(begin)
            ]
        found: list[dict[str, Any]] = self.dircache[path]
        return found

    def invalidate_cache(self, path: str | None = None) -> None:
        self.dircache.clear()

    def ls(self, path: str, detail: bool = True, **_: Any) -> list[Any]:
        path = self._strip_protocol(path)
        depth = path.count("/") + 1
        found: dict[str, dict[str, Any]] = {}
        for about in self._list(path):
            name = "/".join(about["name"].split("/")[: depth + 1])
            is_file = name == about["name"]
            found[name] = about if is_file else {"name": name, "size": 0, "type": "directory"}
        if not found and path not in self.store:
            raise FileNotFoundError(path)
        if not found:
            found[path] = self.info(path)
        return list(found.values()) if detail else list(found)

    def info(self, path: str, **_: Any) -> dict[str, Any]:
        path = self._strip_protocol(path)
        if path in self.store:
            return {"name": path, "size": len(self.store[path]), "type": "file"}
        if any(name.startswith(path + "/") for name in self.store):
            return {"name": path, "size": 0, "type": "directory"}
        raise FileNotFoundError(path)

    def cat_file(
        self, path: str, start: int | None = None, end: int | None = None, **_: Any
    ) -> bytes:
        path = self._strip_protocol(path)
        if path not in self.store:
            raise FileNotFoundError(path)
        return self.store[path][start:end]

    def pipe_file(self, path: str, value: bytes, mode: str = "overwrite", **_: Any) -> None:
        self.store[self._strip_protocol(path)] = bytes(value)

    def put_file(self, lpath: str, rpath: str, *_: Any, **__: Any) -> None:
        with open(lpath, "rb") as file:
            self.pipe_file(rpath, file.read())

    def get_file(self, rpath: str, lpath: Any, *_: Any, **__: Any) -> None:
        data = self.cat_file(rpath)
        with open(lpath, "wb") as file:
            file.write(data)

    def rm_file(self, path: str) -> None:
        path = self._strip_protocol(path)
        if path not in self.store:
            raise FileNotFoundError(path)
        del self.store[path]

    def _rm(self, path: str) -> None:
        self.rm_file(path)

    def rm(self, path: Any, recursive: bool = False, maxdepth: int | None = None) -> None:
        assert not recursive, "a folder is removed, which object stores do not have"
        for name in [path] if isinstance(path, str) else path:
            self.rm_file(name)

    def _open(self, path: str, mode: str = "rb", *_: Any, **__: Any) -> Any:
        raise NotImplementedError(f"{mode}: objects are read and written whole")

    def mkdir(self, path: str, create_parents: bool = True, **_: Any) -> None:
        raise NotImplementedError("there are no folders")

    def makedirs(self, path: str, exist_ok: bool = False) -> None:
        raise NotImplementedError("there are no folders")

    def mv(self, *_: Any, **__: Any) -> None:
        raise NotImplementedError("an object keeps its name")

    def cp_file(self, *_: Any, **__: Any) -> None:
        raise NotImplementedError("objects are not copied here")
