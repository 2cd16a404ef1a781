import { makeAssets } from "../support/assets.js";

export default function setup(): void {
  makeAssets();
}
