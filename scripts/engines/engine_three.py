"""three.js renders its folder in headless Chromium, WebGL 2."""

import numpy as np

import browser
import scene

PAGE = """<!doctype html><meta charset="utf-8"><body><pre id="out">nothing</pre>
<script type="importmap">{"imports": {"three": "./node_modules/three/build/three.module.js",
 "three/addons/": "./node_modules/three/examples/jsm/", "ktx-parse": "./node_modules/ktx-parse/dist/index.mjs"}}</script>
<script type="module">
import * as THREE from 'three';
const told = TOLD, folders = FOLDERS, pictured = PICTURED, out = document.getElementById('out');
const renderer = new THREE.WebGLRenderer();
renderer.shadowMap.enabled = true;
renderer.toneMapping = THREE.NoToneMapping;

async function build(folder, grey) {
  const scene = new THREE.Scene();
  const { sky } = await import(folder + 'sky.js');
  await sky(scene);
  const add = (geometry, material, at = [0, 0, 0]) => {
    const mesh = new THREE.Mesh(geometry, material);
    mesh.position.set(...at); mesh.castShadow = mesh.receiveShadow = true;
    scene.add(mesh);
  };
  const matt = (v) => new THREE.MeshPhysicalMaterial({ color: new THREE.Color(v, v, v), roughness: 1, metalness: 0, specularIntensity: 0 });
  const { radius, height } = told.pole;
  add(new THREE.PlaneGeometry(60, 60).rotateX(-Math.PI / 2), matt(grey ? told.ground : 1));
  add(new THREE.CylinderGeometry(radius, radius, height, 64).translate(0, height / 2, 0), matt(grey ? told.stone : 0));
  for (const s of grey ? told.spheres : []) add(new THREE.SphereGeometry(s.radius, 128, 64), s.metal
    ? new THREE.MeshStandardMaterial({ color: new THREE.Color(s.colour, s.colour, s.colour), roughness: s.roughness, metalness: 1 }) : matt(s.colour), s.at);
  scene.traverse((o) => { if (o.isDirectionalLight) {
    const c = o.shadow.camera; c.left = c.bottom = -5; c.right = c.top = 5; c.far = 200;
    o.shadow.mapSize.set(2048, 2048); o.shadow.normalBias = 0.02;
  } });
  return { scene, white: matt(1) };
}

function look(scene, camera, width, height) {
  const target = new THREE.WebGLRenderTarget(width, height, { type: THREE.FloatType, colorSpace: THREE.LinearSRGBColorSpace });
  renderer.setRenderTarget(target);
  renderer.render(scene, camera);
  const pixels = new Float32Array(4 * width * height);
  renderer.readRenderTargetPixels(target, 0, 0, width, height, pixels);
  target.dispose();
  return pixels;
}

const mean = (pixels) => [0, 1, 2].map((c) => pixels.filter((_, i) => i % 4 === c).reduce((a, b) => a + b) / (pixels.length / 4));

function near(scene, at, normal) {
  const camera = new THREE.OrthographicCamera(-0.01, 0.01, 0.01, -0.01, 0.1, 5);
  camera.position.set(...at).add(normal);
  if (normal.y === 1) camera.up.set(0, 0, -1);
  camera.lookAt(...at);
  return mean(look(scene, camera, 4, 4));
}

async function measure(folder) {
  const { scene, white } = await build(folder, false);
  const places = told.places.map((at) => near(scene, at, new THREE.Vector3(0, 1, 0)));
  scene.traverse((o) => { if (o.isDirectionalLight) o.visible = false; });
  const walls = told.walls.map((n) => {
    const normal = new THREE.Vector3(...n), wall = new THREE.Mesh(new THREE.PlaneGeometry(1, 1), white);
    wall.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), normal);
    wall.position.set(...told.wall_at);
    scene.add(wall);
    const value = near(scene, told.wall_at, normal);
    scene.remove(wall);
    return value;
  });
  const { at, radius } = told.ball;
  const ball = new THREE.Mesh(new THREE.SphereGeometry(radius, 256, 128), new THREE.MeshStandardMaterial({ color: 0xffffff, roughness: 0, metalness: 1 }));
  ball.position.set(...at);
  scene.add(ball);
  const mirrors = told.mirrors.map((n) => near(scene, at.map((v, k) => v + radius * n[k]), new THREE.Vector3(...n)));
  return { places, walls, walls_see_the_sun: false, mirrors };
}

async function picture(folder) {
  const { scene } = await build(folder, true), [width, height] = told.size;
  const camera = new THREE.PerspectiveCamera(told.camera.degrees, width / height, 0.1, 500);
  camera.position.set(...told.camera.eye);
  camera.lookAt(...told.camera.target);
  return Array.from(look(scene, camera, 2 * width, 2 * height).filter((_, i) => i % 4 < 3), (v) => +v.toPrecision(4));
}

try {
  const cases = {};
  for (const name in folders) cases[name] = await measure(folders[name]);
  out.textContent = JSON.stringify({ cases, pixels: pictured && await picture(pictured) });
} catch (e) { out.textContent = 'failed: ' + e + ' ' + e.stack; }
</script>"""


def smaller(pixels):
    """Pixels of twice the width and height, row 0 at the bottom, as those of the picture."""
    width, height = scene.SIZE
    return np.reshape(pixels, (height, 2, width, 2, 3)).mean((1, 3))[::-1]


def work(asked):
    modules, version = browser.package(asked["packages"], "three", "ktx-parse")
    folders, picture = browser.names(asked)
    found = browser.run(asked, modules, PAGE, {"TOLD": scene.told("three"), "FOLDERS": folders, "PICTURED": picture})
    return {"version": version, "cases": found["cases"], "pixels": picture and smaller(found["pixels"])}


if __name__ == "__main__":
    import job

    job.answer(work)
