"""A page in headless Chromium, and the JSON that it leaves in its element `out`."""

import functools
import http.server
import json
import re
import shutil
import subprocess
import threading


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def run(place, modules, page, points, checks):
    """Serves `place` with `node_modules` in it; POINTS in the page become `points`."""
    (place / "node_modules").symlink_to(modules)
    (place / "index.html").write_text(page.replace("POINTS", json.dumps(points, default=float)))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=place))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    done = subprocess.run(
        [browser, "--headless=new", "--enable-logging=stderr", "--no-sandbox", "--use-angle=swiftshader",
         "--enable-unsafe-swiftshader", "--virtual-time-budget=120000", f"--user-data-dir={place}/profile", "--dump-dom",
         f"http://127.0.0.1:{server.server_port}/index.html"],
        capture_output=True, text=True, timeout=300)
    server.shutdown()
    found = re.search(r'<pre id="out">(.*?)</pre>', done.stdout, re.S)
    if not found or not found[1].startswith("["):
        checks.say("the page", False, (found[1] if found else done.stdout[:500]) + done.stderr[-2000:])
        checks.end()
    return json.loads(found[1])
