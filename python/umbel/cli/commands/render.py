"""`umbel render`: path-traced pictures of a mesh or of an asset."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from umbel.cli.inputs import AllowOutside, bytes_of, load_mesh
from umbel.cli.options import Accel, Heatmap, Up, option, switch
from umbel.cli.outputs import check_output, check_references
from umbel.cli.run import Json, Threads, ends_cleanly, fail, heard, is_asset, show, warn_no_effect

if TYPE_CHECKING:
    from collections.abc import Callable

    from umbel.geometry.camera import Camera
    from umbel.geometry.mesh import Mesh
    from umbel.trace.renderer import Film, Renderer
    from umbel.trace.shading import Environment

_COARSE = 20_000  # triangles of the cut on which an asset's cameras are chosen
_MOST_PATHS = 1 << 24  # a pixel
_INSTANCES_BUDGET = "2GB"  # for trees of instances, which are not made one mesh


_FLAGS = {
    "max_bounces": "--bounces",
    "samples": "--spp",
    "budget_bytes": "--budget",
    "environment.color": "--light",
    "environment.sun_azimuth": "--sun",
    "environment.sun_elevation": "--sun",
}


@ends_cleanly(_FLAGS)
def command(
    # Long: typer reads the flags and their help from the signature.
    source: Annotated[
        str, typer.Argument(metavar="INPUT", help="Mesh (.glb .gltf .obj .ply .stl) or asset.")
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="OUT", help="Picture: .png (tone-mapped) or .exr (linear)."
        ),
    ],
    width: int = option(1024, "N", "Pixels."),
    height: int = option(768, "N", "Pixels."),
    spp: int = option(64, "N", "Paths a pixel."),
    camera: list[str] | None = option(
        None,
        "auto|file|x,y,z:tx,ty,tz:fov",
        "From a point to a point with the vertical field of view in degrees; auto: the "
        "mesh fills the picture; auto:AZIMUTH,ELEVATION[:FOV]: from this direction; file: all "
        "cameras of a glTF file; file:NAME or file:NUMBER: one of them. Several cameras make "
        "OUT-1, OUT-2, ...  [default: auto]",
    ),
    accel: Accel | None = option(
        None,
        None,
        "bvh, kdtree, grid (two-level), octree or bih (bounding intervals): all triangles, by the "
        "same picture; lod: the cut that the camera needs, of an asset.  "
        "[default: bvh, lod for assets]",
    ),
    pixel_error: float | None = option(
        None, "P", "Error of a cut in pixels, with lod.  [default: 1]"
    ),
    budget: str | None = option(
        None,
        "SIZE",
        "Most memory of an asset's pages and of what is traced, as in 64MB; errors grow "
        "where it is not enough. Instances share what they show.  [default: none, 2GB for a "
        "tree of instances]",
    ),
    bounce_error: float = option(
        1.0,
        "FACTOR",
        "How many times the pixel error may be for rays that bounce or look for light, "
        "with --budget.",
    ),
    seed: int = option(1, "N", "Of the noise."),
    bounces: int = option(32, "N", "Most bounces of a path."),
    shadow_samples: int = option(2, "N", "Rays to lights at each hit: 0, 1 or 2."),
    clamp: float = option(8.0, "R", "Most radiance of one indirect sample; 0: no limit."),
    exposure: str = option("auto", "auto|STOPS", "Brightness of a PNG."),
    up: Up = option(Up.y, None, "Axis to the zenith."),
    ground: bool = switch("--ground", "Put a floor under the mesh."),
    sun: str | None = option(None, "AZIMUTH,ELEVATION", "Where the sun stands, in degrees."),
    light: str = option("sky", "sky|R,G,B", "A sky with a sun, or one colour from everywhere."),
    hide: list[str] | None = option(
        None, "MATERIAL", "Leave out triangles; * and ? match any name."
    ),
    progressive: bool = switch("--progressive", "Write OUT after 1, 2, 4, ... paths a pixel."),
    denoise: bool = switch("--denoise", "Take the noise out, with Intel's Open Image Denoise."),
    features: bool = switch(
        "--features", "Write OUT-albedo and OUT-normal too, as denoisers read them."
    ),
    heatmap: Heatmap | None = option(
        None,
        None,
        "No path tracing: how many boxes of clusters each pixel's ray pierces. An .exr has the "
        "counts.",
    ),
    clusters: str | None = option(
        None,
        "bisect|morton|hybrid|FILE.npz",
        "Of a mesh, with --heatmap: made so, or read as `umbel cluster -o` writes them.  "
        "[default: bisect]",
    ),
    most: int | None = option(
        None, "N", "Boxes at the end of the heatmap's scale.  [default: the picture's most]"
    ),
    allow_outside: AllowOutside = False,
    as_json: Json = False,
    threads: Threads = 0,
) -> None:
    """Render path-traced pictures of a mesh, or of the cut of an asset that a camera needs."""
    check_output(output, ".png", ".exr", inputs=[source])
    method = _accel(source, accel, pixel_error)
    if heatmap is not None:
        if denoise or features or progressive or budget is not None:
            fail("--heatmap traces no paths: no --denoise, --features, --progressive or --budget")
        from umbel.cli.heatmaps import check_heatmap

        check_heatmap(clusters, most, of_cut=method is Accel.lod)
    elif clusters is not None or most is not None:
        fail("--clusters and --most are for --heatmap")
    if not 1 <= spp <= _MOST_PATHS:
        fail(f"--spp must be from 1 to {_MOST_PATHS}, not {spp}")
    from umbel.trace.denoise import denoiser
    from umbel.trace.picture import check_format, save_features, save_picture, tone_map

    check_format(output)
    written = partial(_checked_outputs, output, features=features, source=source)
    written(len(camera or ["auto"]))
    if denoise:
        denoiser()
    if exposure != "auto":
        tone_map([[[0.0, 0.0, 0.0]]], exposure)  # says now what is wrong with it
    if method is Accel.lod and budget is None and _has_instance_tree(source):
        if heatmap is not None:
            fail("--heatmap is not for assets with a tree of instances")
        budget = _INSTANCES_BUDGET
    limit = None if budget is None else bytes_of("--budget", budget)
    if limit is not None and (method is not Accel.lod or ground):
        fail("--budget is for .umbel assets with --accel lod, without --ground")
    if not bounce_error >= 1 or (bounce_error > 1 and budget is None):
        fail("--bounce-error must be at least 1, and needs --budget")
    from umbel.cli.progress import Bar
    from umbel.trace.renderer import Renderer

    environment = _environment(sun, light)
    settings: dict[str, Any] = {
        "seed": seed,
        "max_bounces": bounces,
        "shadow_samples": shadow_samples,
        "clamp": clamp,
    }
    _check_settings(camera or [], width, height, environment, up.value, settings)
    of_paths = {
        "--spp": spp != 64,
        "--seed": seed != 1,
        "--bounces": bounces != 32,
        "--shadow-samples": shadow_samples != 2,
        "--clamp": clamp != 8.0,
        "--sun": sun is not None,
        "--light": light != "sky",
        "--exposure": exposure != "auto",
        "--ground": ground,
        "--accel": accel is not None and not is_asset(source),
    }
    for flag, is_given in of_paths.items():
        if is_given and heatmap is not None:
            warn_no_effect(flag, "--heatmap traces no paths")
    if exposure != "auto" and heatmap is None and output.suffix.lower() == ".exr":
        warn_no_effect("--exposure", "an .exr has the radiance as it is")
    if most is not None and output.suffix.lower() == ".exr":
        warn_no_effect("--most", "an .exr has the counts as they are")
    began = time.perf_counter()
    with Bar() as bar:
        options: dict[str, Any] = {
            "environment": environment,
            "up": up.value,
            "ground": ground,
            "hide": hide or [],
            "accel": Accel.bvh.value if method is Accel.lod else method.value,
            "threads": threads,
        }

        def prepare(mesh: Mesh) -> Renderer:
            return Renderer(mesh, **options, progress=_part(bar, 0.0, 0.05))

        views: _Views | _Streamed
        if limit is None:
            load = partial(load_mesh, source, allow_outside=allow_outside, threads=threads)
            views = _Views(source, method, pixel_error or 1.0, prepare, load)
        else:
            options["bounce_error"] = bounce_error
            views = _Streamed(source, limit, pixel_error or 1.0, options)
        cameras = [text for given in camera or ["auto"] for text in views.named(given)]
        outputs = written(len(cameras))
        for text in cameras:
            if text.partition(":")[0] == "file":
                views.view(text, width, height)  # says now that the file does not have it
        results: list[dict[str, Any]] = []
        if heatmap is not None:
            assert isinstance(views, _Views)
            for text, path in zip(cameras, outputs, strict=True):
                view = views.view(text, width, height)
                boxes, origin = views.boxes(view, clusters, hide or [], threads)
                results.append(_save_heatmap(path, boxes, view, origin, width, height, most))
            total = {"total_seconds": time.perf_counter() - began}
            show(
                {"input": source, **_joined(results), **total, "warnings": heard},
                as_json,
                str(output),
            )
            return
        for k, (text, path) in enumerate(zip(cameras, outputs, strict=True)):
            renderer, view = views.renderer(text, width, height)
            film = renderer.film(view, width=width, height=height, **settings)
            bounds = [0.05 + 0.95 * (k + i) / len(cameras) for i in (0, 1)]
            for film_now in _passes(film, spp, progressive, _part(bar, *bounds)):
                save_picture(path, film_now.denoised() if denoise else film_now.pixels, exposure)
            if features:
                save_features(path, *film.features())
            results.append(_result(path, renderer, film, view))
    result = _summary(results, spp, method, time.perf_counter() - began)
    show({"input": source, **result, "warnings": heard}, as_json, str(output))


def _accel(source: str, accel: Accel | None, pixel_error: float | None) -> Accel:
    if accel is None:
        accel = Accel.lod if is_asset(source) else Accel.bvh
    if accel is Accel.lod and not is_asset(source):
        fail(f"--accel lod needs a .umbel asset, and {source} is a mesh; umbel build makes one")
    if pixel_error is not None:
        if accel is not Accel.lod:
            fail("--pixel-error is for cuts of a .umbel asset, with --accel lod")
        if not pixel_error > 0:
            fail(f"--pixel-error must be more than 0, not {pixel_error}")
    return accel


def _has_instance_tree(source: str) -> bool:
    from umbel.lod.asset import Asset

    return Asset(source).has_instance_tree


def _environment(sun: str | None, light: str) -> Environment:
    from umbel.trace.shading import Environment

    if light != "sky":
        if sun is not None:
            fail("--sun needs --light sky")
        return Environment(color=_floats(light, 3, "--light must be sky or R,G,B"))
    if sun is None:
        return Environment()
    azimuth, elevation = _floats(sun, 2, "--sun must be AZIMUTH,ELEVATION")
    return Environment(sun_azimuth=azimuth, sun_elevation=elevation)


def _check_settings(
    cameras: list[str],
    width: int,
    height: int,
    environment: Environment,
    up: str,
    settings: dict[str, Any],
) -> None:
    """Refuses settings that no mesh could be rendered with, by one pixel of a triangle."""
    import numpy as np

    from umbel.geometry.mesh import Mesh
    from umbel.trace.renderer import Renderer

    triangle = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.uint32))
    renderer = Renderer(triangle, environment=environment, up=up, threads=1)
    for camera in ("auto", *cameras):
        if camera.partition(":")[0] != "file":
            view = renderer.view(camera, width, height)
            # Far from this triangle, floats may not tell the camera's points apart.
            view = replace(view, position=(1, 1, 1), target=(0, 0, 0))
            renderer.film(view, width=1, height=1, **settings).add(1)


def _floats(text: str, count: int, rule: str) -> list[float]:
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count:
        fail(f"{rule}, not {text!r}")
    return values


def _checked_outputs(output: Path, count: int, *, features: bool, source: str) -> list[Path]:
    """The pictures of so many cameras. They and their features may replace no file of the mesh."""
    from umbel.trace.picture import feature_paths

    pictures = [output]
    if count > 1:
        pictures = [output.with_name(f"{output.stem}-{k + 1}{output.suffix}") for k in range(count)]
    more = [path for picture in pictures for path in feature_paths(picture)] if features else []
    for path in [*pictures, *more]:
        check_output(path, path.suffix.lower(), inputs=[source])
    check_references([*pictures, *more], source)
    return pictures


def _part(bar: Any, begin: float, end: float) -> Callable[[float, str], None]:
    return lambda fraction, stage: bar(begin + (end - begin) * fraction, stage)


def _passes(film: Film, spp: int, progressive: bool, progress: Any) -> Any:
    """Yields the film when it is to be written."""
    if not progressive:
        yield film.add(spp, progress=progress)
        return
    while film.samples < spp:
        before, samples = film.samples, min(max(film.samples, 1), spp - film.samples)
        yield film.add(samples, progress=_part(progress, before / spp, (before + samples) / spp))


class _Views:
    """Renderers for cameras: one for a mesh, one for each camera's cut of an asset."""

    def __init__(
        self,
        source: str,
        method: Accel,
        pixel_error: float,
        prepare: Callable[[Mesh], Renderer],
        load: Callable[[], Mesh],
    ) -> None:
        self._prepare, self._pixel_error = prepare, pixel_error
        self._asset = None
        self._boxes: Any = None  # of the mesh, once they are wanted
        if not is_asset(source):
            self._whole = prepare(load())
            return
        from umbel.lod.asset import Asset

        asset = Asset(source)
        if method is Accel.lod:
            self._asset = asset
            self._whole = prepare(
                asset.scene_mesh(asset.scene_cuts(triangles=_COARSE, or_coarsest=True))
            )
        else:
            self._whole = prepare(asset.scene_mesh(asset.scene_cuts(level=0)))

    def named(self, text: str) -> list[str]:
        """One text a camera: `file` stands for all of the file's."""
        count = len(self._whole.mesh.cameras)
        return [f"file:{k + 1}" for k in range(count)] if text == "file" and count else [text]

    def view(self, text: str, width: int, height: int) -> Camera:
        return replace(self._whole.view(text, width, height), pixel_error=self._pixel_error)

    def boxes(
        self, view: Camera, clusters: str | None, hide: list[str], threads: int
    ) -> tuple[Any, Any]:
        """The boxes of the clusters that the view shows, and what they are relative to."""
        from umbel.cli.heatmaps import boxes_of_cuts, boxes_of_mesh

        if self._asset is not None:
            shown = self._asset.scene_cuts(camera=view)
            return boxes_of_cuts(self._asset, shown, hide), self._asset.origin
        if self._boxes is None:
            self._boxes = boxes_of_mesh(self._whole.mesh, clusters, threads)
        return self._boxes, self._whole.origin

    def renderer(self, text: str, width: int, height: int) -> tuple[Renderer, Camera]:
        """What shows the view, and its camera."""
        view = self.view(text, width, height)
        if self._asset is None:
            return self._whole, view
        shown = self._asset.scene_cuts(camera=view)
        return self._prepare(self._asset.scene_mesh(shown)), view


class _Streamed:
    """Renderers for cameras of an asset, each within a budget."""

    def __init__(
        self, source: str, budget: int, pixel_error: float, options: dict[str, Any]
    ) -> None:
        from umbel.lod.asset import Asset

        self._asset, self._budget, self._pixel_error = Asset(source), budget, pixel_error
        self._options = {
            k: options[k] for k in ("environment", "up", "hide", "bounce_error", "threads")
        }

    def named(self, text: str) -> list[str]:
        return [text]

    def view(self, text: str, width: int, height: int) -> Camera:
        from umbel.lod.instances import asset_boxes
        from umbel.trace.renderer import Renderer

        # From outside, as for a mesh that is no room: boxes would look like one.
        text = "auto:35,15" if text == "auto" else text
        view = Renderer(asset_boxes(self._asset), up=self._options["up"]).view(text, width, height)
        return replace(view, pixel_error=self._pixel_error)

    def renderer(self, text: str, width: int, height: int) -> tuple[Renderer, Camera]:
        from umbel.trace.cut_renderer import CutRenderer

        view, aspect = self.view(text, width, height), width / height
        return CutRenderer(self._asset, view, self._budget, aspect=aspect, **self._options), view


def _result(path: Path, renderer: Renderer, film: Film, camera: Camera) -> dict[str, Any]:
    return {
        **_where(path, camera),
        "triangles": renderer.triangles,
        **_memory(renderer),
        **film.statistics,
    }


def _save_heatmap(
    path: Path, boxes: Any, view: Camera, origin: Any, width: int, height: int, most: int | None
) -> dict[str, Any]:
    from umbel.trace.heatmap import boxes_per_pixel, save_heatmap

    counts = boxes_per_pixel(boxes, view.relative_to(origin), width, height)
    save_heatmap(path, counts, most)
    hit = counts[counts > 0]
    return {
        **_where(path, view),
        "clusters": len(boxes),
        "mean_boxes": float(hit.mean()) if len(hit) else 0.0,
        "most_boxes": int(counts.max()),
    }


def _where(path: Path, camera: Camera) -> dict[str, Any]:
    return {
        "output": str(path),
        "position": list(camera.position),
        "target": list(camera.target or ()),
        "fov": camera.fov_y * 57.29577951308232,
    }


def _joined(results: list[dict[str, Any]]) -> dict[str, Any]:
    if len(results) == 1:
        return results[0]
    return {f"view_{k + 1}": r for k, r in enumerate(results)}


def _memory(renderer: Renderer) -> dict[str, Any]:
    from umbel.trace.cut_renderer import CutRenderer

    if not isinstance(renderer, CutRenderer):
        return {}
    return {
        "scene_bytes": renderer.bytes,
        "page_bytes": renderer.page_bytes,
        "pixel_error": renderer.pixel_error,
    }


def _summary(
    results: list[dict[str, Any]], spp: int, method: Accel, total: float
) -> dict[str, Any]:
    counts = ("primary_rays", "bounce_rays", "shadow_rays", "continued_rays", "rays")
    seconds = sum(r["seconds"] for r in results)
    rays = {key: sum(r[key] for r in results) for key in counts}
    summary: dict[str, Any] = {
        "seconds": seconds,
        "total_seconds": total,
        "mrays_per_second": rays["rays"] / seconds / 1e6 if seconds > 0 else 0.0,
        "triangles": max(r["triangles"] for r in results),
        "samples": spp,
        "accel": method.value,
        **rays,
    }
    if len(results) == 1:
        kept = ("output", "position", "target", "fov", "scene_bytes", "page_bytes", "pixel_error")
        return summary | {k: results[0][k] for k in kept if k in results[0]}
    return summary | _joined(results)
