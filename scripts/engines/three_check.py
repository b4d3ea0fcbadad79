"""three.js renders its folder in headless Chromium: a white diffuse plane, and a pole that throws a shadow.

    three_check.py VENI_CLI NODE_MODULES     NODE_MODULES holds three (0.187) and ktx-parse (2)
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import browser
import sky

PAGE = """<!doctype html><meta charset="utf-8"><body><pre id="out">nothing</pre>
<script type="importmap">{"imports": {"three": "./node_modules/three/build/three.module.js",
 "three/addons/": "./node_modules/three/examples/jsm/", "ktx-parse": "./node_modules/ktx-parse/dist/index.mjs"}}</script>
<script type="module">
import * as THREE from 'three';
import { sky } from './three/sky.js';
const out = document.getElementById('out');
try {
  const renderer = new THREE.WebGLRenderer();
  renderer.shadowMap.enabled = true;
  renderer.toneMapping = THREE.NoToneMapping;
  const scene = new THREE.Scene();
  await sky(scene);
  const white = new THREE.MeshStandardMaterial({ color: 0xffffff, roughness: 1, metalness: 0 });
  white.specularIntensity = 0;
  const physical = new THREE.MeshPhysicalMaterial({ color: 0xffffff, roughness: 1, metalness: 0, specularIntensity: 0 });
  const plane = new THREE.Mesh(new THREE.PlaneGeometry(60, 60).rotateX(-Math.PI / 2), physical);
  plane.receiveShadow = true;
  const pole = new THREE.Mesh(new THREE.CylinderGeometry(0.1, 0.1, 2).translate(0, 1, 0), new THREE.MeshBasicMaterial({ color: 0 }));
  pole.castShadow = true;
  scene.add(plane, pole);
  scene.traverse((o) => { if (o.isDirectionalLight) { o.shadow.camera.left = o.shadow.camera.bottom = -4; o.shadow.camera.right = o.shadow.camera.top = 4;
    o.shadow.camera.far = 200; o.shadow.mapSize.set(1024, 1024); } });
  const target = new THREE.WebGLRenderTarget(4, 4, { type: THREE.FloatType, colorSpace: THREE.LinearSRGBColorSpace });
  const at = (x, z) => {
    const camera = new THREE.OrthographicCamera(-0.01, 0.01, 0.01, -0.01, 0.1, 5);
    camera.position.set(x, 1, z); camera.up.set(0, 0, -1); camera.lookAt(x, 0, z);
    return look(camera);
  };
  const look = (camera) => {
    renderer.setRenderTarget(target); renderer.render(scene, camera);
    const pixels = new Float32Array(64);
    renderer.readRenderTargetPixels(target, 0, 0, 4, 4, pixels);
    return [0, 1, 2].map((c) => pixels.filter((_, i) => i % 4 === c).reduce((a, b) => a + b) / 16);
  };
  const open = POINTS.slice(0, 3).map(([x, z]) => at(x, z));
  scene.traverse((o) => { if (o.isDirectionalLight) o.visible = false; });
  const walls = POINTS.slice(3).map(([x, y, z]) => {
    const normal = new THREE.Vector3(x, y, z), place = new THREE.Vector3(100, 50, 100);
    const wall = new THREE.Mesh(new THREE.PlaneGeometry(1, 1), physical);
    wall.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), normal); wall.position.copy(place); scene.add(wall);
    const camera = new THREE.OrthographicCamera(-0.01, 0.01, 0.01, -0.01, 0.1, 5);
    camera.position.copy(place).add(normal); camera.lookAt(place);
    const value = look(camera); scene.remove(wall);
    return value;
  });
  out.textContent = JSON.stringify([open, walls]);
} catch (e) { out.textContent = 'failed: ' + e + ' ' + e.stack; }
document.title = 'done';
</script>"""


def main():
    binary, modules, checks = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve(), sky.Checks()
    with tempfile.TemporaryDirectory() as place:
        place = Path(place)
        _, scale = sky.folder(binary, place, "three")
        image = sky.read_hdr(place / "sky.hdr")
        # native (x, y, z) is three.js' (x, z, −y)
        away = -np.array([sky.SUN[0], -sky.SUN[1]]) / np.hypot(*sky.SUN[:2])
        points = [[12, 12], list(away), list(-away)] + [[x, z, -y] for x, y, z in sky.WALLS]
        found, walls = browser.run(place, modules, PAGE, points, checks)
        open_plane, behind, before = np.array(found)
        expected = scale * sky.irradiance(image, [0, 0, 1]) / np.pi
        checks.within("plane in the open", open_plane, expected, 0.01)
        checks.say("a metre from the pole, away from the sun", (behind / expected).mean() < 0.8, f"{(behind / expected).mean():.3f}")
        checks.say("a metre from the pole, towards the sun", (before / expected).mean() > 0.8, f"{(before / expected).mean():.3f}")
        sky.check_walls(checks, "three", np.array(walls), scale)
    checks.end()


main()
