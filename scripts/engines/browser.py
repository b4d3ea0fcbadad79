"""A page in headless Chromium, and the JSON that it leaves in its element `out`."""

import functools
import http.server
import json
import os
import re
import shutil
import subprocess
import threading

import job

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def package(packages, *names):
    """The folder node_modules and the version of the first of the packages that must be in it."""
    modules = packages / "node_modules"
    for name in names:
        if not (modules / name / "package.json").is_file():
            raise job.Missing(f"no npm package {name}")
    return modules, json.loads((modules / names[0] / "package.json").read_text())["version"]


def run(asked, modules, page, values):
    """Serves the job's place with `node_modules` in it; names of `values` in the page become those. Gives what the page said."""
    browser = next(filter(None, map(shutil.which, NAMES)), None)
    if not browser:
        raise job.Missing("no Chromium")
    place = asked["place"]
    (place / "node_modules").symlink_to(modules)
    for name, value in values.items():
        page = page.replace(name, json.dumps(value))
    (place / "index.html").write_text(page)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=place))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    done = subprocess.run(
        [browser, "--headless=new", "--enable-logging=stderr", "--no-sandbox", "--use-angle=swiftshader",
         "--enable-unsafe-swiftshader", "--virtual-time-budget=240000", f"--user-data-dir={place}/profile", "--dump-dom",
         f"http://127.0.0.1:{server.server_port}/index.html"],
        capture_output=True, text=True, timeout=300, env={**os.environ, "HOME": str(place)})
    server.shutdown()
    found = re.search(r'<pre id="out">(.*?)</pre>', done.stdout, re.S)
    if not found:
        # not even the page as it was given: a container without what it needs, say
        raise job.Missing(f"Chromium shows no page: {(done.stderr.strip() or 'no reason given')[-300:]}")
    if not found[1].startswith("{"):
        raise RuntimeError(found[1] + done.stderr[-2000:])
    return json.loads(found[1])


def names(asked):
    """The folders as the page has them: relative, by case; and that of the picture."""
    relative = lambda folder: folder and f"./{folder.relative_to(asked['place'])}/"
    return {case: relative(folder) for case, folder in asked["folders"].items()}, relative(asked["picture"])
