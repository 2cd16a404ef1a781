"""The web viewer: in the browser, in a notebook, or as a folder to upload."""

from __future__ import annotations

import html
import os
import shlex
import shutil
import tempfile
import webbrowser
from pathlib import Path

from umbel.errors import Error, warn_lost
from umbel.io.textures.images import beside
from umbel.replacing import folder_to_make
from umbel.viewer.files import address_of, images_beside, images_named, served_name
from umbel.viewer.server import Server, page_folder


class View:
    """An asset in the viewer, served from this process while this object lives.

    As the last value of a notebook's cell it shows the viewer there."""

    def __init__(self, path: str | os.PathLike[str], *, port: int = 0, height: int = 560) -> None:
        self._server = Server(checked(path), port)
        self.height = height

    @property
    def url(self) -> str:
        """The address of the page, on this machine only."""
        return self._server.url

    def open(self) -> bool:
        """Opens the page in the browser; whether there is one."""
        return webbrowser.open(self.url)

    def wait(self) -> None:
        """Until it is closed, or a signal comes."""
        self._server.wait()

    def close(self) -> None:
        """Ends serving."""
        self._server.close()

    def _repr_html_(self) -> str:
        return (
            f'<iframe src="{html.escape(self.url)}" width="100%" height="{self.height}" '
            'style="border:0" allow="clipboard-write" allowfullscreen></iframe>'
        )


def view(path: str | os.PathLike[str], *, port: int = 0, height: int = 560) -> View:
    """Serves the viewer with an asset on this machine's loopback address.

    In a notebook the result shows it inline, `height` pixels high; elsewhere `.open()` opens the
    browser and `.url` is the address. `port` 0 takes any free one. Raises Error where this
    installation was made without the viewer's page."""
    return View(path, port=port, height=height)


def export_viewer(path: str | os.PathLike[str], folder: str | os.PathLike[str]) -> Path:
    """Writes a folder that shows an asset from any static host, with the images that it names, and
    returns its index.html.

    The folder must not exist yet, or be empty. It works best from a host that supports HTTP
    ranges; others send the whole file."""
    asset, target, page = checked(path), Path(folder), page_folder()
    images = images_beside(asset)
    try:
        place = folder_to_make(target)
        with tempfile.TemporaryDirectory(dir=place.parent, prefix=".umbel-") as made:
            whole = Path(made) / "viewer"
            _write(whole, page, asset, images)
            if place.exists():
                place.rmdir()
            whole.rename(place)
    except OSError as error:
        raise Error(f"cannot write {target}: {error.strerror or error}") from None
    missing = [name for name in dict.fromkeys(images_named(asset)) if name not in images]
    if missing:
        warn_lost(f"{target} was written without images that are not beside the asset", missing)
    return target / "index.html"


def serving_command(folder: Path) -> str:
    """What shows an exported folder on this machine: browsers do not load its page from files."""
    named = f"./{folder}" if str(folder).startswith("-") else str(folder)
    return f"python3 -m http.server --bind 127.0.0.1 --directory {shlex.quote(named)}"


def _write(folder: Path, page: Path, asset: Path, images: dict[str, Path]) -> None:
    """The page, the asset and its images, in a folder that is not there yet."""
    for file in page.rglob("*"):
        if file.is_file():
            _copy(file, folder / file.relative_to(page))
    _copy(asset, folder / served_name(asset))
    for name, image in images.items():
        copy = beside(folder, name)
        if copy is not None and not copy.exists():
            _copy(image, copy)
    index = folder / "index.html"
    named = f'<body data-asset="{html.escape(address_of(asset))}">'
    text = index.read_text(encoding="utf-8").replace("<body>", named)
    index.write_text(text, encoding="utf-8")


def _copy(source: Path, target: Path) -> None:
    """Copies a file, and waits until it is on disk: some disks say only then that they are full."""
    try:
        file = source.open("rb")
    except OSError as error:
        raise Error(f"cannot read {source}: {error.strerror or error}") from None
    with file:
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("wb") as out:
            shutil.copyfileobj(file, out, 1 << 20)
            out.flush()
            os.fsync(out.fileno())


def checked(path: str | os.PathLike[str]) -> Path:
    """The path of an asset that can be opened, or an Error that says why not."""
    from umbel.lod.asset import Asset

    asset = Path(path)
    if asset.suffix.lower() != ".umbel":
        raise Error(f"{asset}: the viewer shows .umbel files; `umbel build` makes one of a mesh")
    Asset(asset)
    return asset
