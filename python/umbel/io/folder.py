"""The folder that a file's references are looked for in, and left only where that is allowed."""

from __future__ import annotations

import os
import urllib.parse
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath

from umbel.errors import Error


@dataclass(frozen=True)
class Folder:
    """Where a mesh file lies. `find` and `find_uri` give what its references lead to, and raise
    `umbel.Error` for those that leave it: by "..", as absolute paths, or through links."""

    path: Path
    allow_outside: bool = False
    within: Path | None = None  #: what must not be left, if it is more than `path`

    def at(self, path: Path) -> Folder:
        """The same for names that are from another folder on."""
        return Folder(path, self.allow_outside, self.within or self.path)

    def find(self, name: str, may_miss: bool = False) -> Path:
        """The regular file that a path leads to, from this folder. `may_miss`: or no file."""
        plain = name.replace("\\", "/")
        if not plain.strip() or "\0" in plain:
            raise Error(f"{_shown(name)} is no name of a file")
        found = self.path / plain
        if not self.allow_outside and self._is_outside(plain, found):
            raise Error(
                f"{_shown(name)} lies outside the file's folder and is read only with "
                f"allow_outside=True"
            )
        if not os.path.exists(found):  # nor does a name that no file system takes
            if may_miss:
                return found
            raise Error(f"{_shown(name)} does not exist")
        if not found.is_file():
            raise Error(f"{_shown(name)} is no regular file")
        return found

    def find_uri(self, uri: str, may_miss: bool = False) -> Path:
        """The file that a relative URI, or one of the scheme file:, leads to."""
        try:
            parsed = urllib.parse.urlsplit(uri)
        except ValueError:
            raise Error(f"{_shown(uri)} is no URI") from None
        if len(parsed.scheme) > 1 and parsed.scheme != "file":
            raise Error(f"{_shown(uri)} is no file; only files can be read")
        if parsed.scheme == "file" and not self.allow_outside:
            raise Error(
                f"{_shown(uri)} names a file anywhere and is read only with allow_outside=True"
            )
        # A drive's letter is no scheme, and "?" or "#" that is not encoded is part of a name.
        path = parsed.path if parsed.scheme == "file" else uri
        return self.find(urllib.parse.unquote(path, errors="surrogateescape"), may_miss)

    def _is_outside(self, name: str, found: Path) -> bool:
        if PurePosixPath(name).is_absolute() or PureWindowsPath(name).drive:
            return True
        try:
            real = os.path.realpath(found)
            return not Path(real).is_relative_to(os.path.realpath(self.within or self.path))
        except (OSError, ValueError):  # links in a circle, names that are too long
            return True


def _shown(name: str) -> str:
    return repr(name if len(name) <= 80 else f"{name[:77]}...")
