// The bounding boxes of the drawn clusters, for the overlap mode.

import {
  BoxGeometry,
  InstancedMesh,
  Matrix4,
  MeshBasicMaterial,
  NormalBlending,
  type Scene,
  Vector3,
} from "three";
import type { UmbelMesh } from "umbel/three";

const GEOMETRY = new BoxGeometry(1, 1, 1);
const MATERIAL = new MeshBasicMaterial({
  color: 0xf28c3a,
  transparent: true,
  opacity: 0.05,
  depthTest: false,
  depthWrite: false,
  blending: NormalBlending,
});

export class ClusterBoxes {
  private boxes: InstancedMesh | undefined;
  /** The mesh and the version of its cut that the boxes are of. */
  private cutKey: unknown;

  constructor(private readonly scene: Scene) {}

  hide(): void {
    if (this.boxes) this.boxes.visible = false;
  }

  /** Makes the boxes again at the next `show`. */
  invalidate(): void {
    this.cutKey = undefined;
  }

  show(mesh: UmbelMesh): void {
    const key = mesh.statistics && `${mesh.id} ${mesh.cutVersion}`;
    if (this.boxes && this.cutKey === key) {
      this.boxes.visible = true;
      return;
    }
    this.cutKey = key;
    if (this.boxes) {
      this.scene.remove(this.boxes);
      this.boxes.dispose();
    }
    this.boxes = makeBoxes(mesh);
    this.scene.add(this.boxes);
  }
}

function makeBoxes(mesh: UmbelMesh): InstancedMesh {
  const clusters = [...mesh.clusters()];
  const boxes = new InstancedMesh(GEOMETRY, MATERIAL, Math.max(clusters.length, 1));
  boxes.count = clusters.length;
  boxes.frustumCulled = false;
  const [size, center, matrix] = [new Vector3(), new Vector3(), new Matrix4()];
  clusters.forEach(({ box, matrix: world }, i) => {
    box.getSize(size);
    box.getCenter(center);
    matrix.makeScale(size.x, size.y, size.z).setPosition(center).premultiply(world);
    matrix.premultiply(mesh.matrixWorld);
    boxes.setMatrixAt(i, matrix);
  });
  return boxes;
}
