"""Pictures without noise, and what denoisers are told about them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import umbel
from helpers.commands import Umbel


def film(samples: int, seed: int = 1) -> umbel.Film:
    renderer = umbel.Renderer(umbel.shapes.blob(4), ground=True)
    return renderer.film(width=96, height=72, seed=seed).add(samples)


def test_features_are_albedo_and_normals_of_what_is_seen() -> None:
    albedo, normal = film(2).features(8)
    assert albedo.shape == normal.shape == (72, 96, 3)
    assert albedo.min() >= 0 and albedo.max() <= 1
    assert np.allclose(albedo[36, 48], 0.75, atol=1e-5)  # a mesh without materials
    lengths = np.linalg.norm(normal, axis=2)
    assert lengths.max() <= 1.0001 and lengths[36, 48] > 0.9
    assert np.allclose(normal[-1, 0], [0, 1, 0], atol=1e-5)  # the floor
    again = film(2).features(8)
    assert np.array_equal(albedo, again[0]) and np.array_equal(normal, again[1])


def test_denoised_pictures_are_closer_to_the_truth() -> None:
    pytest.importorskip("pyoidn")
    truth = umbel.tone_map(film(512, seed=9).pixels, 0.0).astype(float)
    noisy = film(16)

    def error(pixels: np.ndarray) -> float:
        return float(np.mean((umbel.tone_map(pixels, 0.0) - truth) ** 2))

    assert error(noisy.denoised()) < 0.5 * error(noisy.pixels)  # 3 dB
    assert error(umbel.denoise(noisy.pixels)) < 0.5 * error(noisy.pixels)
    albedo, _ = noisy.features()
    assert error(umbel.denoise(noisy.pixels, albedo)) < 0.5 * error(noisy.pixels)


@pytest.mark.parametrize("features", [False, True])
def test_the_command_denoises(umbel_command: Umbel, tmp_path: Path, features: bool) -> None:
    pytest.importorskip("pyoidn")
    mesh = tmp_path / "blob.ply"
    umbel.save(mesh, umbel.shapes.blob(3))

    def picture(name: str, *options: object) -> np.ndarray:
        size = ("--width", 64, "--height", 48, "--exposure", 0, "--ground")
        done = umbel_command("render", mesh, "-o", tmp_path / name, *size, *options)
        assert done.status == 0, done.err
        with Image.open(tmp_path / name) as image:
            return np.asarray(image, float)

    truth = picture("truth.png", "--spp", 512, "--seed", 9)
    noisy = picture("noisy.png", "--spp", 16)
    written = ("--features",) if features else ()
    clean = picture("clean.png", "--spp", 16, "--denoise", *written)
    assert np.mean((clean - truth) ** 2) < 0.5 * np.mean((noisy - truth) ** 2)  # 3 dB
    names = {path.name for path in tmp_path.glob("clean*")}
    extra = {"clean-albedo.png", "clean-normal.png"}
    assert names == {"clean.png"} | (extra if features else set())


def test_a_missing_denoiser_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    with pytest.raises(umbel.Error, match=r"umbel\[denoise\]"):
        umbel.render(umbel.shapes.blob(2), width=8, height=8, samples=1, denoise=True)


def test_wrong_shapes_are_named() -> None:
    pytest.importorskip("pyoidn")
    picture = np.zeros((8, 8, 3), np.float32)
    with pytest.raises(umbel.Error, match="shape"):
        umbel.denoise(np.zeros((8, 8)))
    with pytest.raises(umbel.Error, match="albedo has shape"):
        umbel.denoise(picture, np.zeros((4, 8, 3)))
    with pytest.raises(umbel.Error, match="needs an albedo"):
        umbel.denoise(picture, normal=picture)


def test_the_command_writes_features(umbel_command: Umbel, tmp_path: Path) -> None:
    mesh = tmp_path / "blob.ply"
    umbel.save(mesh, umbel.shapes.blob(3))
    small = ("--width", 24, "--height", 16, "--spp", 2)
    umbel_command("render", mesh, "-o", tmp_path / "out.png", *small, "--features")
    for name in ("out.png", "out-albedo.png", "out-normal.png"):
        assert Image.open(tmp_path / name).size == (24, 16)
