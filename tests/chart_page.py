#!/usr/bin/env python3
"""Does the page of a chart work in a real browser, offline and without a single error?

Usage: chart_page.py INDEX.HTML [--screenshot FILE]

Prints one line per check and "N passed, M failed"; exit code 0 if all passed. The browser is that of report_page.py.
"""
import argparse
import pathlib
import sys
import tempfile

from report_page import Browser, Checks, DriverError, check_offline, wait_for


def check_drawing(browser, checks):
    marks = browser.run("return document.querySelectorAll('#drawing [data-i]').length")
    checks.expect("the drawing has marks", marks >= 8, marks)
    text = browser.run("return document.querySelector('#drawing').textContent")
    for words in ("Error against time", "time of a frame (median), ms", "RMSE", "thread", "best of all"):
        checks.expect(f"the drawing says “{words}”", words in text, text[:300])
    width = browser.run("return document.querySelector('#drawing svg').getBoundingClientRect().width")
    checks.expect("the drawing is wide enough to be read", width > 700, width)


def check_hover(browser, checks):
    browser.run("document.querySelectorAll('#drawing [data-i]')[3].dispatchEvent(new PointerEvent('pointerover', {bubbles: true, clientX: 400, clientY: 400}))")
    tip = browser.run("return document.querySelector('#tip').hidden ? '' : document.querySelector('#tip').textContent")
    checks.expect("pointing at a mark shows time, error and the command", all(w in tip for w in ("frame", "color error", "polyptych bench")), tip)
    loaded = browser.run("const i = document.querySelector('#tip img'); return i !== null && i.complete && i.naturalWidth > 0")
    checks.expect("pointing at a mark shows the picture", loaded)
    inside = browser.run("const b = document.querySelector('#tip').getBoundingClientRect(); return b.left >= 0 && b.top >= 0 && b.right <= innerWidth && b.bottom <= innerHeight + 1")
    checks.expect("the note lies inside of the window", inside)


def check_measures(browser, checks):
    names = browser.run("return [...document.querySelectorAll('#measure input')].map((input) => input.value)")
    checks.expect("there are several measures of error", len(names) >= 3, names)
    drawings = set()
    for name in names:
        browser.run("document.querySelector(arguments[0]).click()", f"#measure input[value={name}]")
        drawings.add(browser.run("return document.querySelector('#drawing').innerHTML"))
    checks.expect("each measure has a drawing of its own", len(drawings) == len(names), len(drawings))


def check_tables(browser, checks):
    for table in ("error-table", "axis-table"):
        rows = browser.run("return document.querySelectorAll(arguments[0]).length", f"#{table} tbody tr")
        checks.expect(f"{table} has rows", rows >= 1, rows)
    pictures = browser.run("return [...document.querySelectorAll('#time-sheets img')].every((i) => i.naturalWidth > 0)")
    checks.expect("the equal-time sheet shows pictures", pictures)
    overflow = browser.run("return document.documentElement.scrollWidth - document.documentElement.clientWidth")
    checks.expect("the page is not wider than the window", overflow <= 0, f"{overflow} px too wide")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("page", type=pathlib.Path)
    parser.add_argument("--screenshot", type=pathlib.Path)
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
                for check in (check_drawing, check_hover, check_tables, check_measures):
                    checks.attempt(check.__name__.replace("_", " "), lambda: check(browser, checks))
            check_offline(browser, checks)
            if arguments.screenshot:
                browser.screenshot(arguments.screenshot)
        finally:
            browser.close()
    print(f"{checks.passed} passed, {checks.failed} failed")
    return 1 if checks.failed else 0


if __name__ == "__main__":
    sys.exit(main())
