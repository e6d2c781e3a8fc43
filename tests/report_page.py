#!/usr/bin/env python3
"""Does the page of a comparison report work in a real browser, offline and without a single error?

Usage: report_page.py INDEX.HTML [--screenshots DIR]

Drives Debian's chromium through chromedriver (packages `chromium` and `chromium-driver`; other places through the
variables CHROMIUM and CHROMEDRIVER). Needs nothing beyond Python's standard library. Prints one line per check and
"N passed, M failed" at the end; exit code 0 if all passed, 1 otherwise.
"""
import argparse
import base64
import http.client
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

ELEMENT = "element-6066-11e4-a52e-4f735466cecf"  # the key under which the WebDriver protocol names an element
KEYS = {"left": "\ue012", "right": "\ue014", "down": "\ue015", "escape": "\ue00c", "end": "\ue010"}
PATIENCE_SECONDS = 60
MISSING = ("–", "", "nothing")


class DriverError(Exception):
    """The driver refused a command."""


class Browser:
    """One headless browser, spoken to in the WebDriver protocol."""

    def __init__(self, profile):
        driver = os.environ.get("CHROMEDRIVER") or shutil.which("chromedriver")
        chromium = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
        if not driver or not chromium:
            raise DriverError("chromium or chromedriver not found: install the packages chromium and chromium-driver")
        self.process = subprocess.Popen([driver, "--port=0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.session = None
        self.port = self._read_port()
        arguments = ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run",
                     "--disable-dev-shm-usage", "--force-device-scale-factor=1", f"--user-data-dir={profile}", "--window-size=1280,900"]
        answer = self._send("POST", "/session", {"capabilities": {"alwaysMatch": {
            "browserName": "chrome",
            "goog:chromeOptions": {"binary": chromium, "args": arguments},
            "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"},
        }}})
        self.session = answer["sessionId"]
        self.resize(1280, 900)

    def _read_port(self):
        for line in self.process.stdout:
            if found := re.search(r"started successfully on port (\d+)", line):
                return int(found[1])
        raise DriverError("chromedriver did not start")

    def _send(self, method, path, body=None):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=120)
        connection.request(method, path, None if body is None else json.dumps(body), {"Content-Type": "application/json"})
        value = json.loads(connection.getresponse().read())["value"]
        connection.close()
        if isinstance(value, dict) and "error" in value:
            raise DriverError(f"{value['error']}: {value.get('message', '').splitlines()[0]}")
        return value

    def _post(self, path, body=None):
        return self._send("POST", f"/session/{self.session}{path}", body or {})

    def close(self):
        """Ends the browser and the driver."""
        try:
            if self.session:
                self._send("DELETE", f"/session/{self.session}")
        except (DriverError, OSError):
            pass  # the driver is ended below either way
        self.process.terminate()
        self.process.wait()

    def open(self, url):
        self._post("/url", {"url": url})

    def run(self, script, *arguments):
        """Runs a JavaScript function body in the page and returns its value."""
        return self._post("/execute/sync", {"script": script, "args": list(arguments)})

    def find(self, selector):
        return self._post("/element", {"using": "css selector", "value": selector})

    def press(self, selector, *keys):
        """Focuses an element and types keys into it."""
        self.run("document.querySelector(arguments[0]).focus()", selector)
        presses = [{"type": kind, "value": KEYS.get(key, key)} for key in keys for kind in ("keyDown", "keyUp")]
        self._post("/actions", {"actions": [{"type": "key", "id": "keyboard", "actions": presses}]})

    def choose(self, selector, value):
        """Chooses an option of a select element as a user's choice would."""
        self.run("const select = document.querySelector(arguments[0]); select.value = arguments[1];"
                 "select.dispatchEvent(new Event('change', { bubbles: true }));", selector, value)

    def click(self, selector):
        self.reveal(selector)
        self._send("POST", f"/session/{self.session}/element/{self.find(selector)[ELEMENT]}/click", {})

    def point(self, selector, steps):
        """Moves the mouse over an element; a step is (x, y) as shares of its size, "down" or "up"."""
        self.reveal(selector)
        left, top, width, height = self.run(
            "const box = document.querySelector(arguments[0]).getBoundingClientRect();"
            "return [box.left, box.top, box.width, box.height];", selector)
        actions = []
        for step in steps:
            if step in ("down", "up"):
                actions.append({"type": f"pointer{step.capitalize()}", "button": 0})
            else:
                actions.append({"type": "pointerMove", "duration": 30, "x": int(left + step[0] * width), "y": int(top + step[1] * height)})
        self._post("/actions", {"actions": [{"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": actions}]})

    def wheel(self, selector, delta):
        """Turns the wheel over the middle of an element."""
        self.reveal(selector)
        time.sleep(0.4)  # the page takes a wheel turn right after scrolling for more scrolling
        action = {"type": "scroll", "x": 0, "y": 0, "deltaX": 0, "deltaY": delta, "origin": self.find(selector)}
        self._post("/actions", {"actions": [{"type": "wheel", "id": "wheel", "actions": [action]}]})

    def reveal(self, selector):
        self.run("document.querySelector(arguments[0]).scrollIntoView({ block: 'center' })", selector)

    def resize(self, width, height):
        self.devtools("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def devtools(self, command, **parameters):
        return self._post("/goog/cdp/execute", {"cmd": command, "params": parameters})

    def log(self, kind):
        return self._post("/se/log", {"type": kind})

    def screenshot(self, path):
        path.write_bytes(base64.b64decode(self._send("GET", f"/session/{self.session}/screenshot")))


class Checks:
    """Counts what held and prints a line for each."""

    def __init__(self):
        self.passed = 0
        self.failed = 0

    def expect(self, title, held, found=""):
        self.passed += bool(held)
        self.failed += not held
        print(f"{'ok    ' if held else 'FAILED'} {title}" + ("" if held else f": {found}"), flush=True)

    def attempt(self, title, check):
        """Runs a group of checks; a page that lacks a hook fails the group and not the whole run."""
        try:
            check()
        except (DriverError, KeyError, TypeError, ValueError, IndexError) as error:
            self.expect(title, False, f"{type(error).__name__}: {error}")


def wait_for(browser, script):
    """Waits until a script returns something true; returns whether it did."""
    end = time.monotonic() + PATIENCE_SECONDS
    while time.monotonic() < end:
        if browser.run(script):
            return True
        time.sleep(0.1)
    return False


# A number that changes when the pixels of a canvas change. Prime strides sample it without aligning to columns.
CANVAS_SUM = """
const canvas = document.querySelector(arguments[0]);
const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
let sum = 0;
for (let i = 0; i < pixels.length; i += 7) sum = (sum * 31 + pixels[i]) % 1000000007;
return sum;
"""
PROBE_ROWS = """
return [...document.querySelectorAll('#probe tbody tr')].map((row) => [...row.cells].map((cell) => cell.textContent));
"""


def check_panels(browser, checks):
    count = browser.run("return document.querySelectorAll('#grid .panel[data-backend]').length")
    checks.expect("there are at least two panels", count >= 2, count)
    overflow = browser.run("return document.documentElement.scrollWidth - document.documentElement.clientWidth")
    checks.expect("the page is not wider than the window", overflow <= 0, f"{overflow} px too wide")
    unnamed = browser.run("""return [...document.querySelectorAll('button, select, input, [tabindex="0"]')].filter((control) =>
        !(control.getAttribute('aria-label') || control.getAttribute('aria-labelledby') || control.closest('label') || control.textContent.trim()))
        .map((control) => control.outerHTML.slice(0, 80))""")
    checks.expect("every control has a name for screen readers", not unnamed, unnamed)


def check_channels(browser, checks):
    picture = "#grid .panel canvas"
    sums = {"color": browser.run(CANVAS_SUM, picture)}
    for channel in browser.run("return [...document.querySelectorAll('#channel input:enabled')].map((input) => input.value)"):
        browser.run("document.querySelector(arguments[0]).click()", f"#channel input[value={channel}]")
        sums[channel] = browser.run(CANVAS_SUM, picture)
    checks.expect("the channel selector changes the pictures", len(set(sums.values())) >= 2, sums)
    browser.press("#grid .panel .stage", "1")
    checks.expect("key 1 goes back to color", browser.run(CANVAS_SUM, picture) == sums["color"]
                  and browser.run("return document.querySelector('#channel :checked').value") == "color", sums)


def check_probe(browser, checks):
    def caption():
        return browser.run("return document.querySelector('#probe caption').textContent")

    before = caption()
    browser.point("#grid .panel:nth-child(2) .stage", [(0.3, 0.6), (0.31, 0.62)])
    rows, panels = browser.run(PROBE_ROWS), browser.run("return document.querySelectorAll('#grid .panel').length")
    checks.expect("hovering moves the probe", caption() != before, caption())
    numbers = [row for row in rows if sum(bool(re.search(r"\d", cell)) for cell in row[1:]) >= 1]
    checks.expect("the probe reads numbers in every panel", len(rows) == panels == len(numbers), rows)
    checks.expect("the probe compares with the reference", all(cell not in MISSING for cell in [row[2] for row in rows[1:] if row[1] != "–"]), rows)
    reticles = browser.run("""return [...document.querySelectorAll('#grid .stage')].map((stage) => {
        const [outer, inner] = [stage.getBoundingClientRect(), stage.querySelector('.reticle').getBoundingClientRect()];
        return ((inner.left + inner.right) / 2 - outer.left) / outer.width; })""")
    checks.expect("every panel shows the cross at the same place", max(reticles) - min(reticles) < 0.01 and abs(reticles[0] - 0.31) < 0.02, reticles)
    hovered = caption()
    browser.press("#grid .panel .stage", "right", "down")
    x, y = map(int, re.findall(r"\d+", hovered)[:2])
    checks.expect("arrow keys move the probe by a pixel", f"{x + 1}, {y + 1}" in caption() and "held" in caption(), (hovered, caption()))
    browser.press("#grid .panel .stage", "escape")
    checks.expect("Escape lets the probe go", "held" not in caption(), caption())


def check_zoom(browser, checks):
    def transforms():
        return browser.run("return [...document.querySelectorAll('.picture')].map((picture) => getComputedStyle(picture).transform.split(',')[0])")

    fitted = transforms()
    browser.wheel("#grid .panel .stage", -300)
    zoomed = transforms()
    checks.expect("the wheel zooms every picture alike", len(set(zoomed)) == 1 and zoomed != fitted, zoomed)
    before = browser.run("return getComputedStyle(document.querySelector('.picture')).transform")
    browser.point("#grid .panel .stage", [(0.5, 0.5), "down", (0.3, 0.4), (0.25, 0.35), "up"])
    checks.expect("dragging pans", browser.run("return getComputedStyle(document.querySelector('.picture')).transform") != before, before)
    browser.press("#grid .panel .stage", "+", "+", "+", "+")
    checks.expect("strong zoom shows pixels", browser.run("return getComputedStyle(document.querySelector('.picture')).imageRendering") == "pixelated")
    browser.press("#grid .panel .stage", "0")
    checks.expect("key 0 fits the pictures again", transforms() == fitted, transforms())


def check_wipe(browser, checks):
    def position():
        return float(browser.run("return document.querySelector('#wipe-divider').getAttribute('aria-valuenow')"))

    start = position()
    browser.point("#wipe-divider", [(0.5, 0.4), "down", (-6.0, 0.4), (-8.0, 0.4), "up"])
    dragged = position()
    checks.expect("the pointer moves the wipe", dragged < start, (start, dragged))
    browser.press("#wipe-divider", "right", "right")
    checks.expect("keys move the wipe", position() > dragged, (dragged, position()))
    browser.press("#wipe-divider", "end")
    checks.expect("the End key moves the wipe to the edge", position() == 100, position())
    last = browser.run("return document.querySelector('#wipe-b').options.length - 1")
    picture = "#wipe-stage > canvas"
    browser.choose("#wipe-b", "0")
    first = browser.run(CANVAS_SUM, picture)
    browser.choose("#wipe-b", str(last))
    checks.expect("the wipe shows the panels that were chosen", browser.run(CANVAS_SUM, picture) != first or last == 0, last)
    browser.run("document.querySelector('#wipe-divider').dispatchEvent(new MouseEvent('dblclick', { bubbles: true }))")


def check_difference(browser, checks):
    channels = browser.run("return [...document.querySelector('#diff-channel').options].map((option) => option.value)")
    panels = browser.run("return [...document.querySelector('#diff-panel').options].map((option) => option.value)")
    sentences = {}
    for panel in panels:
        browser.choose("#diff-panel", panel)
        for channel in channels:
            browser.choose("#diff-channel", channel)
            sentences[panel, channel] = browser.run("return document.querySelector('#difference-summary').textContent")
    checks.expect("the difference states numbers", any(re.search(r"\d+ of .* pixels differ|No pixel", text) for text in sentences.values()), sentences)
    differing = next((pair for pair, text in sentences.items() if "levels" in text), None)
    if differing is None:
        print("       (no two pictures differ: amplification not checked)")
        return
    browser.choose("#diff-panel", differing[0])
    browser.choose("#diff-channel", differing[1])
    plain = [browser.run(CANVAS_SUM, f"#{stage} canvas") for stage in ("diff-stage", "error-stage")]
    browser.run("document.querySelector('#diff-gain input[value=\"16\"]').click()")
    strong = [browser.run(CANVAS_SUM, f"#{stage} canvas") for stage in ("diff-stage", "error-stage")]
    checks.expect("amplification changes both difference pictures", plain[0] != strong[0] and plain[1] != strong[1], (plain, strong))
    legend = browser.run("return document.querySelector('#error-legend').textContent")
    checks.expect("the error map has a legend with units", "level" in legend and re.search(r"\d", legend), legend)


def check_tables(browser, checks):
    def column(index):
        return browser.run("return [...document.querySelectorAll('#errors tbody tr')].map((row) => row.cells[arguments[0]].textContent)", index)

    rows = column(0)
    checks.expect("the error table has a row for each panel", len(rows) == browser.run("return document.querySelectorAll('#grid .panel').length"), rows)
    heading = "document.querySelector('#errors thead tr:last-child th button').click()"
    browser.run(heading)
    rising = column(0)
    browser.run(heading)
    checks.expect("a column heading sorts both ways", column(0) == rising[::-1] and sorted(rising) == sorted(rows), (rising, column(0)))
    sort = browser.run("return document.querySelector('#errors thead tr:last-child th').getAttribute('aria-sort')")
    checks.expect("the sorted column says so", sort == "descending", sort)
    if browser.run("return document.querySelector('#grid button.badge') !== null"):
        browser.click("#grid button.badge")
        checks.expect("the badge opens the list of objects", browser.run("return document.querySelector('#decisions').open"))
        browser.click("#decisions form button")
        checks.expect("the list of objects closes", not browser.run("return document.querySelector('#decisions').open"))


def check_offline(browser, checks):
    complaints = [entry["message"] for entry in browser.log("browser") if entry["level"] in ("SEVERE", "ERROR")]
    checks.expect("the console shows no error", not complaints, complaints)
    foreign = []
    for entry in browser.log("performance"):
        event = json.loads(entry["message"])["message"]
        url = event["params"].get("request", {}).get("url", "") if event["method"] == "Network.requestWillBeSent" else ""
        if url and not url.startswith(("file:", "data:", "blob:")):
            foreign.append(url[:100])
    checks.expect("the page asks the network for nothing", not foreign, foreign)


def check_narrow(browser, checks):
    browser.resize(400, 800)
    time.sleep(0.3)
    overflow = browser.run("return document.documentElement.scrollWidth - document.documentElement.clientWidth")
    checks.expect("a narrow window needs no sideways scrolling", overflow <= 0, f"{overflow} px too wide")
    browser.resize(1280, 900)


def take_screenshots(browser, folder):
    folder.mkdir(parents=True, exist_ok=True)
    places = {"grid": "header", "probe": "#probe", "wipe": "#wipe-stage", "difference": "#difference-views", "tables": "#errors", "origin": "#origin"}
    browser.run("document.activeElement.blur()")
    for theme in ("light", "dark"):
        browser.devtools("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": theme}])
        for name, selector in places.items():
            browser.reveal(selector)
            time.sleep(0.2)
            browser.screenshot(folder / f"{name}-{theme}.png")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("page", type=pathlib.Path)
    parser.add_argument("--screenshots", type=pathlib.Path, help="folder for pictures of the page, light and dark")
    arguments = parser.parse_args()
    checks = Checks()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        try:
            browser = Browser(profile)
        except DriverError as error:
            print(f"error: {error}")
            return 1
        try:
            browser.open("about:blank")
            browser.log("performance")  # forgets what the browser's own first page loaded
            browser.open(arguments.page.resolve().as_uri())
            ready = wait_for(browser, "return window.polyptychReady === true")
            checks.expect("the page becomes ready", ready)
            if ready:
                for check in (check_panels, check_channels, check_probe, check_zoom, check_wipe, check_difference, check_tables, check_narrow):
                    checks.attempt(check.__name__.replace("_", " "), lambda: check(browser, checks))
            check_offline(browser, checks)
            if arguments.screenshots:
                take_screenshots(browser, arguments.screenshots)
        finally:
            browser.close()
    print(f"{checks.passed} passed, {checks.failed} failed")
    return 1 if checks.failed else 0


if __name__ == "__main__":
    sys.exit(main())
