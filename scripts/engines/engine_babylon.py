"""Babylon.js renders its folder, or the glTF of ours through its loader, in headless Chromium, WebGL 2."""

import browser
import job
import scene
from engine_three import smaller

PAGE = """<!doctype html><meta charset="utf-8"><body><pre id="out">nothing</pre><canvas id="c" width="64" height="64"></canvas>
<script src="./node_modules/babylonjs/babylon.js"></script><script src="./node_modules/babylonjs-loaders/babylonjs.loaders.js"></script>
<script type="module">
const told = TOLD, folders = FOLDERS, pictured = PICTURED, gltf = GLTF, out = document.getElementById('out');
const vector = (v) => new BABYLON.Vector3(...v);

async function build(folder, grey, width, height) {
  const canvas = document.getElementById('c');
  canvas.width = width; canvas.height = height;  // cameras take their aspect from it
  const engine = new BABYLON.Engine(canvas, false), scene = new BABYLON.Scene(engine);
  scene.imageProcessingConfiguration.applyByPostProcess = true;  // materials stay linear
  const camera = new BABYLON.FreeCamera('camera', new BABYLON.Vector3(0, 1, 0), scene);
  camera.minZ = 0.01;
  if (gltf) {
    await BABYLON.SceneLoader.AppendAsync(folder, 'sky.glb', scene);
    scene.environmentTexture.gammaSpace = false;  // as README.txt says
  }
  else (await import(folder + 'sky.js')).sky(BABYLON, scene, folder);
  const material = (v, metallic, roughness) => {
    const made = new BABYLON.PBRMaterial('m', scene);
    made.albedoColor = new BABYLON.Color3(v, v, v); made.metallic = metallic; made.roughness = roughness;
    if (!metallic) made.metallicF0Factor = 0;
    return made;
  };
  const light = scene.lights.find((l) => l.getClassName() === 'DirectionalLight'), solid = [];
  const add = (mesh, material, at) => { mesh.position = vector(at); mesh.material = material; mesh.receiveShadows = true; solid.push(mesh); };
  const { radius, height: tall } = told.pole;
  add(BABYLON.MeshBuilder.CreateGround('plane', { width: 60, height: 60 }, scene), material(grey ? told.ground : 1, 0, 1), [0, 0, 0]);
  add(BABYLON.MeshBuilder.CreateCylinder('pole', { diameter: 2 * radius, height: tall, tessellation: 64 }, scene), material(grey ? told.stone : 0, 0, 1), [0, tall / 2, 0]);
  for (const s of grey ? told.spheres : []) add(BABYLON.MeshBuilder.CreateSphere('sphere', { diameter: 2 * s.radius, segments: 64 }, scene), material(s.colour, s.metal ? 1 : 0, s.roughness), s.at);
  if (light) {
    light.position = light.direction.scale(-20);
    light.autoUpdateExtends = false;
    light.orthoLeft = light.orthoBottom = -5; light.orthoRight = light.orthoTop = 5; light.shadowMinZ = 1; light.shadowMaxZ = 60;
    const shadow = new BABYLON.ShadowGenerator(2048, light);
    solid.slice(1).forEach((mesh) => shadow.addShadowCaster(mesh)); shadow.bias = 0.002; shadow.normalBias = 0.01;
  }
  const target = new BABYLON.RenderTargetTexture('target', { width, height }, scene, { type: BABYLON.Constants.TEXTURETYPE_FLOAT, generateMipMaps: false });
  target.renderList = grey ? null : solid.slice(0, 1); target.activeCamera = camera; target.samples = 1;
  scene.customRenderTargets.push(target);
  await scene.whenReadyAsync();
  return { engine, scene, camera, light, target, white: material(1, 0, 1), mirror: material(1, 1, 0) };
}

async function look({ scene, target }) {
  for (let k = 0; k < 3; k++) scene.render();
  return target.readPixels();
}

async function measure(folder) {
  const built = await build(folder, false, 4, 4), { camera, light, target, scene } = built;
  camera.mode = BABYLON.Camera.ORTHOGRAPHIC_CAMERA;
  camera.orthoLeft = camera.orthoBottom = -0.01; camera.orthoRight = camera.orthoTop = 0.01;
  const near = async (at, normal) => {
    camera.position = vector(at).add(vector(normal));
    if (normal[1] === 1) camera.rotation.set(Math.PI / 2, 0, 0); else camera.setTarget(vector(at));
    const pixels = await look(built);
    return [0, 1, 2].map((c) => pixels.filter((_, i) => i % 4 === c).reduce((a, b) => a + b) / 16);
  };
  const places = [], walls = [];
  for (const at of told.places) places.push(await near(at, [0, 1, 0]));
  if (light) light.setEnabled(false);
  const wall = BABYLON.MeshBuilder.CreateBox('wall', { size: 1 }, scene);
  wall.material = built.white; target.renderList.push(wall);
  for (const n of told.walls) {
    wall.position = vector(told.wall_at).subtract(vector(n).scale(0.5));
    walls.push(await near(told.wall_at, n));
  }
  const { at, radius } = told.ball, ball = BABYLON.MeshBuilder.CreateSphere('ball', { diameter: 2 * radius, segments: 128 }, scene);
  ball.position = vector(at); ball.material = built.mirror; target.renderList.push(ball);
  const mirrors = [];
  for (const n of told.mirrors) mirrors.push(await near(at.map((v, k) => v + radius * n[k]), n));
  built.engine.dispose();
  return { places, walls, walls_see_the_sun: false, mirrors };
}

async function picture(folder) {
  const [width, height] = told.size, built = await build(folder, true, 2 * width, 2 * height);
  built.camera.fov = told.camera.degrees * Math.PI / 180;
  built.camera.position = vector(told.camera.eye);
  built.camera.setTarget(vector(told.camera.target));
  const pixels = await look(built);
  return Array.from(pixels.filter((_, i) => i % 4 < 3), (v) => +v.toPrecision(4));
}

try {
  const cases = {};
  for (const name in folders) cases[name] = await measure(folders[name]);
  out.textContent = JSON.stringify({ cases, pixels: pictured && await picture(pictured) });
} catch (e) { out.textContent = 'failed: ' + e + ' ' + e.stack; }
</script>"""


def work(asked):
    modules, version = browser.package(asked["packages"], "babylonjs", "babylonjs-loaders")
    folders, picture = browser.names(asked)
    told, gltf = scene.told(asked["engine"]), asked["engine"] == "gltf"
    found = browser.run(asked, modules, PAGE, {"TOLD": told, "FOLDERS": folders, "PICTURED": picture, "GLTF": gltf})
    return {"version": version, "cases": found["cases"], "pixels": picture and smaller(found["pixels"])}


job.answer(work)
