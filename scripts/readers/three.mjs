// Reads EXR and .hdr files with the loaders of one version of three.js: node three.mjs PACKAGE FILE OUT
// OUT receives width and height (u32), then R, G, B of every pixel (f32), row 0 on top.
import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";
import path from "node:path";

const [folder, file, out] = process.argv.slice(2);
const load = (name) => import(pathToFileURL(path.join(folder, name)).href);
const bytes = readFileSync(file);
const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
const { FloatType } = await load("build/three.module.js");
const isExr = file.endsWith(".exr");
const { EXRLoader } = isExr ? await load("examples/jsm/loaders/EXRLoader.js") : {};
const { HDRLoader } = isExr ? {} : await load("examples/jsm/loaders/HDRLoader.js");
const loader = isExr ? new EXRLoader() : new HDRLoader();
const image = loader.setDataType(FloatType).parse(buffer);
const { width, height, data } = image;
const channels = data.length / (width * height);
const pixels = new Float32Array(3 * width * height);
for (let y = 0; y < height; y++) {
  // the loader of EXR files turns them over
  const from = isExr ? height - 1 - y : y;
  for (let x = 0; x < width; x++)
    for (let c = 0; c < 3; c++) pixels[3 * (y * width + x) + c] = data[channels * (from * width + x) + c];
}
writeFileSync(out, Buffer.concat([Buffer.from(Uint32Array.of(width, height).buffer), Buffer.from(pixels.buffer)]));
