// The key and the fill light, which move with the camera.

import { DirectionalLight, type Scene } from "three";
import { FILL_LIGHT, KEY_LIGHT, type LightSetup } from "./lights";
import type { OrbitCamera } from "./orbit_camera";

export class LightRig {
  private readonly lights = [KEY_LIGHT, FILL_LIGHT].map((setup) => ({
    setup,
    light: new DirectionalLight(setup.color, setup.intensity),
  }));

  constructor(scene: Scene) {
    for (const { light } of this.lights) scene.add(light, light.target);
  }

  follow({ perspective, target }: OrbitCamera): void {
    for (const { setup, light } of this.lights) {
      const { from }: LightSetup = setup;
      light.target.position.copy(target);
      light.position
        .set(...from)
        .applyQuaternion(perspective.quaternion)
        .add(target);
      light.target.updateMatrixWorld();
    }
  }
}
