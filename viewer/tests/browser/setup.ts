import { makeAssets } from "../assets.js";

export default function setup(): void {
  makeAssets();
}
