"""three.js renders its folder in headless Chromium: a white diffuse plane, and a pole that throws a shadow.

    three_check.py VENI_CLI NODE_MODULES     NODE_MODULES holds three (0.187) and ktx-parse (2)
"""

import functools
import http.server
import json
import re
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import numpy as np

import sky

PAGE = """<!doctype html><meta charset="utf-8"><body><pre id="out">nothing</pre>
<script type="importmap">{"imports": {"three": "./node_modules/three/build/three.module.js",
 "three/addons/": "./node_modules/three/examples/jsm/", "ktx-parse": "./node_modules/ktx-parse/dist/ktx-parse.modern.js"}}</script>
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
    renderer.setRenderTarget(target); renderer.render(scene, camera);
    const pixels = new Float32Array(64);
    renderer.readRenderTargetPixels(target, 0, 0, 4, 4, pixels);
    return [0, 1, 2].map((c) => pixels.filter((_, i) => i % 4 === c).reduce((a, b) => a + b) / 16);
  };
  out.textContent = JSON.stringify(POINTS.map(([x, z]) => at(x, z)));
} catch (e) { out.textContent = 'failed: ' + e + ' ' + e.stack; }
document.title = 'done';
</script>"""


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def main():
    binary, modules, checks = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve(), sky.Checks()
    with tempfile.TemporaryDirectory() as place:
        place = Path(place)
        _, scale = sky.folder(binary, place, "three")
        image = sky.read_hdr(place / "sky.hdr")
        (place / "node_modules").symlink_to(modules)
        # native (x, y, z) is three.js' (x, z, −y)
        away = -np.array([sky.SUN[0], -sky.SUN[1]]) / np.hypot(*sky.SUN[:2])
        points = [[12, 12], list(away), list(-away)]
        (place / "index.html").write_text(PAGE.replace("POINTS", json.dumps(points)))
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=place))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        browser = shutil.which("chromium") or shutil.which("google-chrome")
        text = subprocess.run(
            [browser, "--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--virtual-time-budget=120000",
             f"--user-data-dir={place}/profile", "--dump-dom", f"http://127.0.0.1:{server.server_port}/index.html"],
            capture_output=True, text=True, timeout=300).stdout
        server.shutdown()
        found = re.search(r'<pre id="out">(.*?)</pre>', text, re.S)
        if not found or not found[1].startswith("["):
            checks.say("the page", False, found[1] if found else text[:500])
            checks.end()
        open_plane, behind, before = np.array(json.loads(found[1]))
        expected = scale * sky.irradiance(image, [0, 0, 1]) / np.pi
        checks.within("plane in the open", open_plane, expected, 0.01)
        checks.say("a metre from the pole, away from the sun", (behind / expected).mean() < 0.8, f"{(behind / expected).mean():.3f}")
        checks.say("a metre from the pole, towards the sun", (before / expected).mean() > 0.8, f"{(before / expected).mean():.3f}")
    checks.end()


main()
