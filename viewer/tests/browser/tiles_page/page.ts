// Shows a tileset with 3d-tiles-renderer: ?tileset=URL&pixels=ERROR. Sets `window.shown` once all
// tiles that the view needs are there.
import { TilesRenderer } from "3d-tiles-renderer";
import { GLTFExtensionsPlugin } from "3d-tiles-renderer/plugins";
import {
  AmbientLight,
  DirectionalLight,
  PerspectiveCamera,
  Scene,
  Sphere,
  WebGLRenderer,
} from "three";
import { MeshoptDecoder } from "three/examples/jsm/libs/meshopt_decoder.module.js";

declare global {
  var shown: { triangles: number; tiles: number; failed: number } | undefined;
}

const query = new URL(location.href).searchParams;
const canvas = document.querySelector("canvas") as HTMLCanvasElement;
const renderer = new WebGLRenderer({ canvas, preserveDrawingBuffer: true });
renderer.setSize(canvas.width, canvas.height, false);
renderer.setClearColor(0xff0000);
const scene = new Scene();
const camera = new PerspectiveCamera(40, canvas.width / canvas.height);
const tiles = new TilesRenderer(query.get("tileset") ?? "");
tiles.registerPlugin(new GLTFExtensionsPlugin({ meshoptDecoder: MeshoptDecoder }));
tiles.errorTarget = Number(query.get("pixels") ?? 6);
tiles.setCamera(camera);
tiles.setResolutionFromRenderer(camera, renderer);
const sun = new DirectionalLight(0xffffff, 3);
scene.add(tiles.group, sun, new AmbientLight(0xffffff, 0.5));

let failed = 0;
tiles.addEventListener("load-error", () => ++failed);
const sphere = new Sphere();
let quiet = 0;

function frame(): void {
  if (tiles.getBoundingSphere(sphere)) {
    const away = (sphere.radius * 1.05) / Math.sin((camera.fov * Math.PI) / 360);
    camera.position.copy(sphere.center).add({ x: 0, y: -away, z: 0 });
    camera.up.set(0, 0, 1);
    camera.near = away / 100;
    camera.far = away * 3;
    camera.lookAt(sphere.center);
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
    sun.position.copy(camera.position);
  }
  tiles.update();
  renderer.render(scene, camera);
  const visible = tiles.visibleTiles.size;
  quiet = visible > 0 && tiles.loadProgress === 1 ? quiet + 1 : 0;
  if (quiet > 3)
    globalThis.shown = { triangles: renderer.info.render.triangles, tiles: visible, failed };
  requestAnimationFrame(frame);
}
frame();
