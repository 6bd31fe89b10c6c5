"""Make the picture of the demo's page: `python -m tools.docs.screenshot INDEX.html`.

docs/pictures/page.png: the upper part of the page. docs/pictures/page.txt: the lines of
the verdict that it shows, which a test compares with what the docs say.
docs/outputs/verdict.txt: the verdict as a run prints it, for `make docs` to quote.
Needs chromium with its chromedriver.
"""

import argparse
import base64
import io
import shutil
from pathlib import Path

from PIL import Image
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

from alignerf.experiment import targets

# Of the page; the picture is smaller.
WIDTH_PX, HEIGHT_PX, WINDOW_PX, SCALE = 1000, 1420, 2000, 0.8
SWITCHES = ("headless=new", "no-sandbox", "disable-gpu", "disable-dev-shm-usage")
SWITCHES += ("hide-scrollbars", "force-color-profile=srgb")
READY = "return document.querySelector('#slider').classList.contains('rendered')"


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("page", type=Path, help="results/SCENE/index.html")
    parser.add_argument("--root", default=".", type=Path, help="the project's folder")
    args = parser.parse_args(argv)
    pictures = args.root / "docs" / "pictures"
    browser = started()
    try:
        browser.get(args.page.resolve().as_uri())
        WebDriverWait(browser, 20).until(lambda one: one.execute_script(READY))
        lines = browser.find_elements(
            By.CSS_SELECTOR, "h1, #verdict li, #verdict .todo"
        )
        text = "".join(f"{line.text}\n" for line in lines)
        clip = {"x": 0, "y": 0, "width": WIDTH_PX, "height": HEIGHT_PX, "scale": SCALE}
        picture = browser.execute_cdp_cmd("Page.captureScreenshot", {"clip": clip})
    finally:
        browser.quit()
    write(pictures, picture["data"], text)
    folder = args.page.resolve().parent
    (args.root / "docs" / "outputs" / "verdict.txt").write_text(printed(folder))


def started():
    """A headless browser, its page as wide as the picture."""
    found = shutil.which("chromium") or shutil.which("chromium-browser")
    driver = shutil.which("chromedriver")
    if not (found and driver):
        raise SystemExit("error: no chromium with its chromedriver")
    options = webdriver.ChromeOptions()
    options.binary_location = found
    for switch in SWITCHES:
        options.add_argument(f"--{switch}")
    service = webdriver.ChromeService(executable_path=driver)
    browser = webdriver.Chrome(options=options, service=service)
    size = {"width": WIDTH_PX, "height": WINDOW_PX}
    size |= {"deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    return browser


def write(folder, data, text):
    """The picture, of few colours, and what it says."""
    image = Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")
    image.quantize(256).save(folder / "page.png", optimize=True)
    (folder / "page.txt").write_text(text)


def printed(folder):
    """The verdict of a scene's folder, as the last lines of its run say it."""
    lines = targets.verdicts([folder.name], results=folder.parent)
    shown = [line.replace(f"{folder.parent}/", "results/") for line in lines]
    return "\n".join(shown).strip("\n") + "\n"


if __name__ == "__main__":
    main()
