// Khronos's glTF validator on files: one JSON object, each file's errors and warnings by its name.
//
//     npm run validate -- a.glb b.gltf
import { readFile } from "node:fs/promises";
import { dirname, join } from "node:path";
import validator from "gltf-validator";

const SEVERITIES = ["errors", "warnings"];

async function validated(path) {
  const report = await validator.validateBytes(new Uint8Array(await readFile(path)), {
    uri: path,
    maxIssues: 0,
    externalResourceFunction: async (uri) =>
      new Uint8Array(await readFile(join(dirname(path), decodeURIComponent(uri)))),
  });
  const found = { errors: [], warnings: [] };
  for (const { severity, code, pointer, message } of report.issues.messages) {
    found[SEVERITIES[severity]]?.push(`${code} ${pointer}: ${message}`);
  }
  return found;
}

const out = {};
for (const path of process.argv.slice(2)) {
  out[path] = await validated(path);
}
process.stdout.write(`${JSON.stringify(out)}\n`);
