import { makeAssets } from "../support/assets.js";

export default makeAssets;
