import { makeAssets } from "../assets.js";

export default makeAssets;
