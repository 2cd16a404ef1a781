import { Texture, type WebGLRenderer } from "three";
import { expect, test, vi } from "vitest";
import { ImageDecoder } from "../../../../packages/umbel/src/three/textures/image_decoder.js";

const paths: string[] = [];
vi.mock("three/addons/loaders/KTX2Loader.js", () => ({
  KTX2Loader: class {
    setTranscoderPath(path: string) {
      paths.push(path);
      return this;
    }
    detectSupport() {
      return this;
    }
    async init() {}
    parse(_bytes: ArrayBuffer, done: (texture: Texture) => void) {
      done(new Texture());
    }
  },
}));
vi.stubGlobal(
  "Worker",
  class {
    set onmessage(answer: () => void) {
      answer();
    }
    terminate() {}
  },
);

test("the transcoder's folder may be named with a slash at its end or without", async () => {
  const ktx2 = Uint8Array.from([0xab, 0x4b, 0x54, 0x58, 0x20, 0x32, 0x30, 0xbb, 13, 10, 26, 10]);
  for (const path of ["", "/basis", "/basis/", "https://a.test/b"])
    await new ImageDecoder(path).decode(ktx2, {} as WebGLRenderer);
  expect(paths).toEqual(["", "/basis/", "/basis/", "https://a.test/b/"]);
});
