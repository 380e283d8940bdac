"""Reads the reports of two runs, in the folder of the first argument, as people's tools read them.

Screenshots go to the folder of the second argument, where there is one.
"""

import collections
import json
import pathlib
import subprocess
import sys

import jsonschema
import junitparser
import sarif.loader
import sarif_pydantic
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

OUT = pathlib.Path(sys.argv[1]).resolve()
SHOTS = pathlib.Path(sys.argv[2]) if sys.argv[2] else None
SCHEMA = json.loads(pathlib.Path("reports/report.schema.json").read_text())


def main():
    for name in ["everything", "mutant"]:
        report = json.loads((OUT / f"{name}.json").read_text())
        jsonschema.validate(report, SCHEMA)
        junit_agrees(name, report)
        frames_are_read(name, report)
        sarif_agrees(name, report)
    browser = chromium()
    try:
        for name in ["everything", "mutant", "compared"]:
            report = json.loads((OUT / f"{'mutant' if name == 'compared' else name}.json").read_text())
            page_agrees(browser, name, report)
        page_leads_to_the_frames(browser)
        page_shows_the_checks_of_cia(browser, report)
        page_has_devices_side_by_side(browser)
        keys_work(browser)
        page_fits_a_telephone_and_the_night(browser)
    finally:
        browser.quit()
    print("JSON, JUnit, pcapng and the page are read as they were meant")


def cases(report):
    return [(device["name"], case) for device in report["devices"] for case in device["cases"]]


def junit_agrees(name, report):
    xml = junitparser.JUnitXml.fromfile(str(OUT / f"{name}.xml"))
    counts = report["counts"]
    assert xml.tests == sum(counts.values()), (xml.tests, counts)
    assert xml.failures == counts["FAIL"], (xml.failures, counts)
    assert xml.errors == counts["ERROR"], (xml.errors, counts)


def sarif_agrees(name, report):
    """Each cause is a result, at a line of a file."""
    text = (OUT / f"{name}.sarif").read_text()
    read = sarif_pydantic.Sarif.model_validate_json(text)
    results = read.runs[0].results or []
    assert len(results) == len(report["causes"]), (len(results), len(report["causes"]))
    for result in results:
        place = result.locations[0].physical_location
        assert place.artifact_location.uri.startswith("suites/"), place
        assert place.region.start_line > 0, place
    counts = sarif.loader.load_sarif_file(str(OUT / f"{name}.sarif")).get_result_count()
    assert counts == len(results), counts


def frames_are_read(name, report):
    """tshark finds each frame of a case, and CANopen in it."""
    if name == "everything":
        return
    options = ["-d", "can.subdissector,canopen", "-T", "fields", "-e", "frame.protocols"]
    command = ["tshark", "-r", str(OUT / f"{name}.pcapng"), *options]
    said = subprocess.run(command, capture_output=True, text=True, check=True)
    protocols = collections.Counter(line.split(":")[-1] for line in said.stdout.splitlines())
    frames = sum(case["frames"] for _, case in cases(report))
    # Attempts that were repeated are recorded, too.
    assert sum(protocols.values()) >= frames, (protocols, frames)
    assert protocols["canopen"] > 0.95 * frames, protocols


def chromium():
    options = webdriver.ChromeOptions()
    options.binary_location = "/usr/bin/chromium"
    for option in [
        "headless", "no-sandbox", "disable-gpu", "disable-quic", "no-first-run", "disable-sync",
        "disable-background-networking", "disable-component-update", "hide-scrollbars",
    ]:
        options.add_argument(f"--{option}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    return webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)


def look(browser, width=1280, height=1600, scheme="light"):
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    media = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)


def open_page(browser, name, fragment=""):
    browser.get("about:blank")
    browser.get((OUT / f"{name}.html").as_uri() + fragment)
    assert browser.get_log("browser") == []
    for entry in browser.get_log("performance"):
        message = json.loads(entry["message"])["message"]
        if message["method"] == "Network.requestWillBeSent":
            url = message["params"]["request"]["url"]
            assert url.startswith(("file:", "about:", "data:")), f"the page asks for {url}"


def shoot(browser, name):
    if SHOTS:
        SHOTS.mkdir(parents=True, exist_ok=True)
        browser.save_screenshot(str(SHOTS / f"{name}.png"))


def text(browser, selector):
    return browser.find_element(By.CSS_SELECTOR, selector).text


def shown(browser, expected):
    """Waits until the list shows so many cases."""
    def is_there(_):
        return text(browser, "#shown").split(" of ")[0] == str(expected)
    WebDriverWait(browser, 20).until(is_there, f"{text(browser, '#shown')}, not {expected}")


def page_agrees(browser, name, report):
    look(browser)
    open_page(browser, name)
    shoot(browser, name)
    total = sum(report["counts"].values())
    assert text(browser, "#shown") == f"{total} of {total}", text(browser, "#shown")
    boxes = browser.find_elements(By.CSS_SELECTOR, "#verdicts label")
    counts = {box.text.split()[-2]: int(box.text.split()[-1]) for box in boxes}
    assert counts == {name: count for name, count in report["counts"].items() if count}, counts
    causes = browser.find_elements(By.CSS_SELECTOR, ".cause")
    assert len(causes) == len(report["causes"])
    squares = browser.find_elements(By.CSS_SELECTOR, ".grid a")
    assert len(squares) == len(report["requirements"])
    # The filter takes names, sentences and requirements.
    for word in ["heartbeat", "CIA301-NMT-01"]:
        low = word.lower()
        fits = [
            case for _, case in cases(report)
            if low in case["name"].lower() or low in case["title"].lower()
            or any(low in it.lower() for it in case["requirements"])
        ]
        field = browser.find_element(By.ID, "text")
        field.clear()
        field.send_keys(word)
        shown(browser, len(fits))
    field.clear()
    field.send_keys(" ")
    shown(browser, total)
    for box in browser.find_elements(By.CSS_SELECTOR, "#verdicts input"):
        if box.get_attribute("data-verdict") != "pass":
            box.click()
    shown(browser, report["counts"]["PASS"])


def page_leads_to_the_frames(browser):
    """From a cause to its case, and from there to what was on the bus."""
    look(browser)
    open_page(browser, "mutant")
    cause = browser.find_element(By.CSS_SELECTOR, ".cause")
    cause.find_element(By.TAG_NAME, "summary").click()
    cause.find_element(By.CSS_SELECTOR, "li a").click()
    WebDriverWait(browser, 20).until(lambda _: browser.find_elements(By.CSS_SELECTOR, ".lane.tx"))
    panel = text(browser, ".case:not([hidden])")
    for said in ["requires", "expected", "came", "run again", "SDO node 2"]:
        assert said in panel, panel
    shoot(browser, "case")
    link = browser.current_url
    assert "#case=generic" in link, link
    browser.get("about:blank")
    browser.get(link)
    assert browser.find_elements(By.CSS_SELECTOR, ".row[aria-expanded=true]"), "a link opens its case"
    requirement = browser.find_element(By.CSS_SELECTOR, ".grid a.fail")
    browser.execute_script("arguments[0].click()", requirement)
    field = browser.find_element(By.ID, "text")
    wanted = requirement.get_attribute("aria-label").split()[0]
    WebDriverWait(browser, 20).until(lambda _: field.get_attribute("value") == wanted)


def page_shows_the_checks_of_cia(browser, report):
    """By number: each has the row of its verdict, and leads to the cases that make it."""
    look(browser)
    open_page(browser, "mutant")
    checks = {it["number"]: it for it in report["tool-checks"]}
    rows = browser.find_elements(By.CSS_SELECTOR, "#tool-checks tbody tr")
    assert len(rows) == len(checks) == 127
    failed = [it["number"] for it in checks.values() if it["verdict"] == "FAIL"]
    links = browser.find_elements(By.CSS_SELECTOR, "#tool-checks > .wide a")
    assert [it.text for it in links] == failed and failed, failed
    browser.execute_script("arguments[0].click()", links[0])
    shown(browser, sum(checks[failed[0]]["cases"].values()))
    shoot(browser, "checks")


def page_has_devices_side_by_side(browser):
    """What was tested twice: the columns of the device, before and now."""
    look(browser)
    open_page(browser, "both", "#side-by-side")
    shoot(browser, "both")
    heads = [it.text for it in browser.find_elements(By.CSS_SELECTOR, "#side-by-side th")]
    assert "generic" in heads and "generic (2)" in heads, heads
    rows = browser.find_elements(By.CSS_SELECTOR, "#side-by-side .wide:first-of-type tbody tr")
    rows = [row.text for row in rows]
    # The mutant has the last column.
    assert rows and all(row.split()[-1] in {"FAIL", "ERROR", "LENIENT"} for row in rows), rows


def keys_work(browser):
    open_page(browser, "mutant")
    body = browser.find_element(By.TAG_NAME, "body")
    body.send_keys("/")
    active = "return document.activeElement.id || document.activeElement.tagName"
    assert browser.execute_script(active) == "text"
    browser.switch_to.active_element.send_keys("\ue00c")
    body.send_keys("j")
    assert browser.execute_script(active) == "SUMMARY"


def page_fits_a_telephone_and_the_night(browser):
    colour = "return getComputedStyle(document.body).backgroundColor"
    seen = set()
    for scheme in ["light", "dark"]:
        for width in [1280, 390]:
            look(browser, width, 1600, scheme)
            open_page(browser, "mutant")
            wide = browser.execute_script("return document.documentElement.scrollWidth")
            assert wide <= width, f"{wide} pixels on a screen of {width}"
            seen.add(browser.execute_script(colour))
            shoot(browser, f"mutant-{scheme}-{width}")
    assert len(seen) == 2, seen


main()
