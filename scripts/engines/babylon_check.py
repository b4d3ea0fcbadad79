"""Babylon.js renders its folder, and the glTF of ours through its loader, in headless Chromium: a white diffuse plane, and a pole that
throws a shadow.

    babylon_check.py VENI_CLI NODE_MODULES     NODE_MODULES holds babylonjs and babylonjs-loaders (9)
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import browser
import sky

PAGE = """<!doctype html><meta charset="utf-8"><body><pre id="out">nothing</pre><canvas id="c" width="64" height="64"></canvas>
<script src="./node_modules/babylonjs/babylon.js"></script><script src="./node_modules/babylonjs-loaders/babylonjs.loaders.js"></script>
<script type="module">
const out = document.getElementById('out');
const build = async (load, points) => {
  const engine = new BABYLON.Engine(document.getElementById('c'), false);
  const scene = new BABYLON.Scene(engine);
  scene.imageProcessingConfiguration.applyByPostProcess = true;  // materials stay linear
  const camera = new BABYLON.FreeCamera('camera', new BABYLON.Vector3(0, 1, 0), scene);
  camera.mode = BABYLON.Camera.ORTHOGRAPHIC_CAMERA;
  camera.orthoLeft = camera.orthoBottom = -0.01; camera.orthoRight = camera.orthoTop = 0.01;
  camera.rotation.x = Math.PI / 2; camera.minZ = 0.01;
  await load(scene);
  const white = new BABYLON.PBRMaterial('white', scene);
  white.albedoColor = BABYLON.Color3.White(); white.metallic = 0; white.roughness = 1; white.metallicF0Factor = 0;
  const plane = BABYLON.MeshBuilder.CreateGround('plane', { width: 60, height: 60 }, scene);
  plane.material = white; plane.receiveShadows = true;
  const pole = BABYLON.MeshBuilder.CreateCylinder('pole', { diameter: 0.2, height: 2 }, scene);
  pole.position.y = 1;
  const light = scene.lights.find((l) => l.getClassName() === 'DirectionalLight');
  if (light) {
    light.position = light.direction.scale(-20);
    light.autoUpdateExtends = false;
    light.orthoLeft = light.orthoBottom = -4; light.orthoRight = light.orthoTop = 4; light.shadowMinZ = 1; light.shadowMaxZ = 60;
    const shadow = new BABYLON.ShadowGenerator(1024, light);
    shadow.addShadowCaster(pole); shadow.bias = 0.002;
  }
  const target = new BABYLON.RenderTargetTexture('target', 4, scene, { type: BABYLON.Constants.TEXTURETYPE_FLOAT, generateMipMaps: false });
  target.renderList = [plane]; target.activeCamera = camera; target.samples = 1;
  scene.customRenderTargets.push(target);
  await scene.whenReadyAsync();
  const values = [];
  const wall = BABYLON.MeshBuilder.CreateBox('wall', { size: 1 }, scene);
  wall.material = white; target.renderList.push(wall);
  for (const [x, z, y] of points) {
    camera.position.set(x, 1, z);
    if (y !== undefined) {
      const normal = new BABYLON.Vector3(x, y, z), place = new BABYLON.Vector3(100, 50, 100);
      if (light) light.setEnabled(false);
      wall.position = place; camera.position = place.add(normal); camera.setTarget(place);
    }
    for (let k = 0; k < 3; k++) scene.render();
    const pixels = await target.readPixels();
    values.push([0, 1, 2].map((c) => pixels.filter((_, i) => i % 4 === c).reduce((a, b) => a + b) / 16));
  }
  engine.dispose();
  return values;
};
try {
  const { sky } = await import('./babylon/sky.js');
  const env = await build((scene) => sky(BABYLON, scene, 'babylon/'), POINTS[0]);
  const gltf = await build((scene) => BABYLON.SceneLoader.AppendAsync('gltf/', 'sky.glb', scene), POINTS[1]);
  out.textContent = JSON.stringify([env, gltf]);
} catch (e) { out.textContent = 'failed: ' + e + ' ' + e.stack; }
</script>"""


def main():
    binary, modules, checks = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve(), sky.Checks()
    with tempfile.TemporaryDirectory() as place:
        place = Path(place)
        _, scale = sky.folder(binary, place, "babylon")
        sky.folder(binary, place, "gltf")
        image = sky.read_hdr(place / "sky.hdr")
        # native (x, y, z) is Babylon's (−y, z, x); the loader's world is (−x, y, z) of glTF's (x, z, −y), that is (−x, z, −y)
        sides = {"babylon": np.array([-sky.SUN[1], sky.SUN[0]]), "gltf": np.array([-sky.SUN[0], -sky.SUN[1]])}
        expected = scale * sky.irradiance(image, [0, 0, 1]) / np.pi
        unit = {name: side / np.linalg.norm(side) for name, side in sides.items()}
        walls = {"babylon": [[-y, x, z] for x, y, z in sky.WALLS], "gltf": [[-x, -y, z] for x, y, z in sky.WALLS]}
        points = [[[12, 12], list(-unit[name]), list(unit[name])] + walls[name] for name in unit]
        found = browser.run(place, modules, PAGE, points, checks)
        for k, name in enumerate(unit):
            values = np.array(found[k])
            checks.within(f"{name}: plane in the open", values[0], expected, 0.01)
            behind, before = [(values[1 + i] / expected).mean() for i in (0, 1)]
            checks.say(f"{name}: a metre from the pole, away from the sun", behind < 0.8, f"{behind:.3f}")
            checks.say(f"{name}: a metre from the pole, towards the sun", before > 0.8, f"{before:.3f}")
            sky.check_walls(checks, name, values[3:], scale)
    checks.end()


main()
