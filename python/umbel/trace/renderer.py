"""Path-traced pictures of meshes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbel import _umbel
from umbel.errors import Error
from umbel.geometry.arrays import as_mesh, native, thread_count
from umbel.geometry.camera import Camera
from umbel.geometry.mesh import Mesh
from umbel.geometry.origin import origin_of, zero_origin
from umbel.geometry.repair import Progress
from umbel.trace.shading import Environment, Shading, axes_of, plain, triple, without

_FOV = 35.0
_AZIMUTH, _ELEVATION, _MARGIN = 35.0, 15.0, 0.06
#: Half the sides of the nested squares that make the ground, in diagonals of the mesh's box. The
#: outer ones reach the horizon, and the inner one is small because its coordinates must be fine.
_GROUND = (2.0, 16.0, 128.0, 1024.0)


def native_camera(camera: Camera, up: str = "y") -> _umbel.TraceCamera:
    """The library's camera. `up` is the axis to the zenith, for a camera that does not say."""
    if camera.target is None:
        raise Error("a camera for a picture needs a target")
    out = _umbel.TraceCamera()
    out.position = triple(camera.position, "the camera's position")
    out.target = triple(camera.target, "the camera's target")
    out.up = triple(axes_of(up)[0] if camera.up is None else camera.up, "the camera's up")
    out.fov_y = camera.fov_y
    return out


class Renderer:
    """A mesh (a Mesh, a path, anything with .vertices and .faces) ready to be rendered from any
    number of cameras.

    environment: the light; a sky with a sun by default.
    up: the axis to the zenith, "y" or "z".
    ground: puts a matte floor under the mesh.
    hide: names of materials whose triangles are left out, `*` and `?` as in shells.
    accel: what rays go through: "bvh", "kdtree", "grid", "octree" or "bih"; pictures are the same.
    preset: of the bvh, "fast", "quality" or "best".
    """

    def __init__(
        self,
        mesh: Any,
        *,
        environment: Environment | None = None,
        up: str = "y",
        ground: bool = False,
        hide: Sequence[str] = (),
        accel: str = "bvh",
        preset: str = "quality",
        progress: Progress | None = None,
        threads: int = 0,
    ) -> None:
        self.mesh = without(as_mesh(mesh), hide)
        self.origin = origin_of(self.mesh.origin)
        """Where what is traced lies in the world."""
        self.up = up
        shading = Shading(self.mesh)
        light = (environment or Environment()).native(up)
        drawn, materials = self.mesh, shading.materials
        if ground:
            drawn, materials = _with_ground(self.mesh, up, materials)
        self._ground = drawn is not self.mesh
        self._threads = thread_count(threads)
        self._scene = _umbel.trace_scene(
            native(drawn),
            materials,
            shading.textures,
            light,
            accel,
            preset,
            progress,
            self._threads,
        )

    def __repr__(self) -> str:
        return f"<Renderer: {self.triangles} triangles, {self.lights} of them lights>"

    @property
    def triangles(self) -> int:
        """Triangles of the mesh, without the ground."""
        return len(self.mesh.triangles)

    @property
    def lights(self) -> int:
        """Triangles that emit light."""
        return self._scene.light_count

    def camera(
        self, camera: Camera | str = "auto", width: int = 1024, height: int = 768
    ) -> _umbel.TraceCamera:
        """A camera as `umbel.render` describes it, for a picture of this size. What comes back is
        relative to `origin`, and good for this renderer alone; see `view`."""
        width, height = _size(width, height)
        if isinstance(camera, Camera):
            return self._native(camera)
        if not isinstance(camera, str):
            raise Error(f"camera must be an umbel.Camera or a text, not {camera!r}")
        word, _, rest = camera.partition(":")
        if word == "auto":
            return self._auto(rest, width, height, camera)
        if word == "file":
            return self._native(self._of_file(rest))
        parts = camera.split(":")
        if len(parts) not in (2, 3):
            raise Error(f"camera must be auto, file or x,y,z:tx,ty,tz:fov, not {camera!r}")
        fov = math.radians(_numbers(parts[2], 1, camera)[0] if len(parts) == 3 else _FOV)
        ends = [_numbers(part, 3, camera) for part in parts[:2]]
        return self._native(Camera(ends[0], ends[1], fov_y=fov))

    def view(self, camera: Camera | str = "auto", width: int = 1024, height: int = 768) -> Camera:
        """The same in the world, for any renderer."""
        native = self.camera(camera, width, height)
        position, target = (
            tuple((self.origin + np.array(point)).tolist())
            for point in (native.position, native.target)
        )
        return Camera(position, target, native.fov_y, height, up=native.up)

    def _native(self, camera: Camera) -> _umbel.TraceCamera:
        return native_camera(camera.relative_to(self.origin), self.up)

    def _of_file(self, which: str) -> Camera:
        """A camera of the mesh's file by its name or its number from 1; the first for ""."""
        cameras = self.mesh.cameras
        if not cameras:
            raise Error("the mesh's file has no perspective camera")
        for k, camera in enumerate(cameras):
            if which in ("", camera.name, str(k + 1)):
                return camera
        known = ", ".join(
            f"{k + 1} ({c.name})" if c.name else str(k + 1) for k, c in enumerate(cameras)
        )
        raise Error(f"the file has no camera {which!r}; there are {known}")

    def _auto(self, text: str, width: int, height: int, whole: str) -> _umbel.TraceCamera:
        """`auto`, or from outside `auto:AZIMUTH,ELEVATION[:FOV]`."""
        view = {"azimuth": _AZIMUTH, "elevation": _ELEVATION, "fov_y": math.radians(_FOV)}
        if text:
            angles, _, fov = text.partition(":")
            view["azimuth"], view["elevation"] = _numbers(angles, 2, whole)
            if fov:
                view["fov_y"] = math.radians(_numbers(fov, 1, whole)[0])
        view["margin"] = _MARGIN
        if text or self._ground:
            x, y, z = axes_of(self.up)[0]
            return _umbel.trace_frame(native(self.mesh), (x, y, z), width, height, **view)
        return self._scene.auto_camera(width, height, **view)

    def film(
        self,
        camera: Camera | str | _umbel.TraceCamera = "auto",
        *,
        width: int = 1024,
        height: int = 768,
        seed: int = 1,
        max_bounces: int = 32,
        shadow_samples: int = 2,
        clamp: float = 8.0,
    ) -> Film:
        """An empty picture, to which samples are added."""
        width, height = _size(width, height)
        if not isinstance(camera, _umbel.TraceCamera):
            camera = self.camera(camera, width, height)
        settings = _umbel.TraceSettings()
        given = {
            "width": width,
            "height": height,
            "seed": seed,
            "max_bounces": max_bounces,
            "shadow_samples": shadow_samples,
            "clamp": clamp,
        }
        for key, value in given.items():
            _set(settings, key, value)
        return Film(self._scene, camera, settings, self._threads)


class Film:
    """A picture that gets better with every call of `add`."""

    def __init__(
        self,
        scene: _umbel.TraceScene,
        camera: _umbel.TraceCamera,
        settings: _umbel.TraceSettings,
        threads: int,
    ) -> None:
        self._native = _umbel.TraceFilm()
        self._scene, self._settings, self._threads = scene, settings, threads
        self.camera = camera

    def add(self, samples: int, *, progress: Progress | None = None) -> Film:
        """Traces so many more paths a pixel. Adding 4 and 12 gives the same picture as adding
        16, bit by bit. If `progress` cancels, the film stays as it was."""
        _set(self._settings, "samples", samples)
        self._native.add(self._scene, self.camera, self._settings, progress, self._threads)
        return self

    @property
    def samples(self) -> int:
        """Paths a pixel so far."""
        return self._native.samples

    @property
    def pixels(self) -> NDArray[np.float32]:
        """(height, width, 3) float32 linear radiance with sRGB's primaries, the top row first."""
        if not self.samples:
            raise Error("the film is empty; add samples first")
        return self._native.pixels()

    def features(
        self, samples: int | None = None, *, progress: Progress | None = None
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """What a denoiser wants to know: the albedo and the normal, in the world, of what each
        pixel shows, as (height, width, 3) float32. Means over `samples` paths a pixel; None: those
        of the film, at most 32."""
        if samples is None:
            samples = min(max(self.samples, 1), 32)
        _set(self._settings, "samples", samples)
        return _umbel.trace_features(
            self._scene, self.camera, self._settings, progress, self._threads
        )

    def denoised(self) -> NDArray[np.float32]:
        """The pixels without their noise, as `umbel.denoise` makes them with the features. Needs
        the package pyoidn."""
        from umbel.trace.denoise import denoise, denoiser

        denoiser()
        return denoise(self.pixels, *self.features())

    @property
    def statistics(self) -> dict[str, Any]:
        """Rays by what they were for (primary_rays, bounce_rays, shadow_rays, continued_rays;
        rays: all), `seconds` of tracing, and mrays_per_second."""
        found = dict(self._native.statistics)
        seconds = found["seconds"]
        found["mrays_per_second"] = found["rays"] / seconds / 1e6 if seconds > 0 else 0.0
        return found


def render(
    mesh: Any,
    *,
    camera: Camera | str = "auto",
    width: int = 1024,
    height: int = 768,
    samples: int = 64,
    seed: int = 1,
    environment: Environment | None = None,
    up: str = "y",
    ground: bool = False,
    hide: Sequence[str] = (),
    max_bounces: int = 32,
    shadow_samples: int = 2,
    clamp: float = 8.0,
    denoise: bool = False,
    progress: Progress | None = None,
    threads: int = 0,
) -> NDArray[np.float32]:
    """A path-traced picture of a mesh: (height, width, 3) float32 linear radiance.

    camera: "auto" finds a view that the mesh fills, or one inside a room;
        "auto:AZIMUTH,ELEVATION[:FOV]" the same from this direction, in degrees;
        "x,y,z:tx,ty,tz[:FOV]" from a point to a point; "file" is the first camera that a glTF
        file has, "file:NAME" or "file:NUMBER" another; or an `umbel.Camera` with a target.
    samples: paths a pixel; noise falls with their square root.
    seed: another one gives other noise; the same gives the same bytes, for any threads.
    max_bounces: after which a path ends, if Russian roulette has not ended it.
    shadow_samples: rays to lights at each hit, 0 to 2.
    clamp: most radiance of one indirect sample, against bright specks; 0 for no limit.
    denoise: takes the noise out at the end; needs the package pyoidn.
    environment, up, ground, hide: see `Renderer`.

    `umbel.save_picture` writes the result.
    """
    if denoise:
        from umbel.trace.denoise import denoiser

        denoiser()
    renderer = Renderer(
        mesh,
        environment=environment,
        up=up,
        ground=ground,
        hide=hide,
        progress=_share(progress, 0.0, 0.1),
        threads=threads,
    )
    film = renderer.film(
        camera,
        width=width,
        height=height,
        seed=seed,
        max_bounces=max_bounces,
        shadow_samples=shadow_samples,
        clamp=clamp,
    )
    film.add(samples, progress=_share(progress, 0.1, 1.0))
    return film.denoised() if denoise else film.pixels


def _share(progress: Progress | None, begin: float, end: float) -> Callable[..., Any] | None:
    """The part [begin, end] of a whole job's progress."""
    if progress is None:
        return None
    return lambda fraction, stage: progress(begin + (end - begin) * fraction, stage)


def _with_ground(
    mesh: Mesh, up: str, materials: list[_umbel.TraceMaterial]
) -> tuple[Mesh, list[_umbel.TraceMaterial]]:
    """The mesh on a square that reaches beyond what is seen of it."""
    bounds = replace(mesh, origin=zero_origin()).bounds
    if bounds is None or not np.isfinite(bounds).all():
        return mesh, materials
    low, high = bounds.astype(np.float64)
    zenith, front = (np.array(axis) for axis in axes_of(up))
    side = np.cross(zenith, front)
    size = float(np.linalg.norm(high - low))
    # A little lower, so that faces that lie on the floor are not in it.
    middle = (low + high) / 2 - zenith * (float(zenith @ (high - low)) * 0.5005)
    ring = [a * front + b * side for a, b in ((-1, -1), (-1, 1), (1, 1), (1, -1))]
    corners = np.array([middle + size * half * corner for half in _GROUND for corner in ring])
    faces = np.array(_ground_triangles(), np.uint32) + np.uint32(len(mesh.positions))

    def grown(values: Any, row: Sequence[float]) -> Any:
        return (
            None
            if values is None
            else np.concatenate([values, np.full((len(corners), len(row)), row)])
        )

    ids = mesh.material_ids
    if ids is None or not materials:
        ids, materials = np.zeros(len(mesh.triangles), np.uint32), [plain()]
    floor = plain(0.4)
    drawn = replace(
        mesh,
        positions=np.concatenate([mesh.positions, corners.astype(np.float32)]),
        triangles=np.concatenate([mesh.triangles, faces]),
        normals=grown(mesh.normals, tuple(zenith)),
        tangents=grown(mesh.tangents, (1.0, 0.0, 0.0, 1.0)),
        uvs=grown(mesh.uvs, (0.0, 0.0)),
        colors=grown(mesh.colors, (1.0, 1.0, 1.0, 1.0)),
        uv_sets=[grown(uvs, (0.0, 0.0)) for uvs in mesh.uv_sets],
        # The tracer does not read these, so the floor needs none.
        joints=None,
        weights=None,
        material_ids=np.concatenate([ids, np.full(len(faces), len(materials), np.uint32)]),
    )
    return drawn, [*materials, floor]


def _ground_triangles() -> list[tuple[int, int, int]]:
    """The innermost square and the rings around it, four corners each."""
    found = [(0, 1, 2), (0, 2, 3)]
    for inner in range(0, 4 * len(_GROUND) - 4, 4):
        for k in range(4):
            a, b = inner + k, inner + (k + 1) % 4
            found += [(a, a + 4, b + 4), (a, b + 4, b)]
    return found


def _numbers(text: str, count: int, whole: str) -> list[float]:
    words = text.split(",")
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = []
    if len(values) != count or not all(math.isfinite(v) for v in values):
        raise Error(
            f"camera {whole!r}: {text!r} should be {count} number{'s' if count > 1 else ''}"
        )
    return values


def _size(width: int, height: int) -> tuple[int, int]:
    for name, value in (("width", width), ("height", height)):
        if not isinstance(value, (int, np.integer)) or not 1 <= value <= 32768:
            raise Error(f"{name} must be from 1 to 32768, not {value!r}")
    return int(width), int(height)


def _set(settings: _umbel.TraceSettings, key: str, value: Any) -> None:
    try:
        setattr(settings, key, value)
    except (TypeError, OverflowError, ValueError):
        raise Error(f"{key} cannot be {value!r}") from None
