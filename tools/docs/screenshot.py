"""Make the pictures of the demo's page: `python -m tools.docs.screenshot INDEX.html`.

docs/pictures/page_WIDTH_THEME.jpg: the upper part of the page, as wide as a screen, a
tablet and a phone; page.jpg: the first of them, smaller, which README shows.
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
from selenium.webdriver.support.ui import WebDriverWait

from alignerf.experiment import targets

# The page's widths in px, and how many screens of it are shown.
WIDTHS, THEMES, SCREENS = (1400, 800, 400), ("light", "dark"), 2.0
SCREEN_PX, README_PX, QUALITY = 900, 1000, 82
SWITCHES = ("headless=new", "no-sandbox", "disable-gpu", "disable-dev-shm-usage")
SWITCHES += ("hide-scrollbars", "force-color-profile=srgb")
READY = "return [...document.querySelectorAll('#panes img')].every(i => i.naturalWidth)"


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("page", type=Path, help="results/SCENE/index.html")
    parser.add_argument("--root", default=".", type=Path, help="the project's folder")
    args = parser.parse_args(argv)
    pictures = args.root / "docs" / "pictures"
    browser = started()
    try:
        for width in WIDTHS:
            for theme in THEMES:
                image = taken(browser, args.page.resolve().as_uri(), width, theme)
                image.save(pictures / f"page_{width}_{theme}.jpg", quality=QUALITY)
                if (width, theme) == (WIDTHS[0], THEMES[0]):
                    image.thumbnail((README_PX, image.height))
                    image.save(pictures / "page.jpg", quality=QUALITY)
    finally:
        browser.quit()
    folder = args.page.resolve().parent
    (args.root / "docs" / "outputs" / "verdict.txt").write_text(printed(folder))


def started():
    """A headless browser."""
    found = shutil.which("chromium") or shutil.which("chromium-browser")
    driver = shutil.which("chromedriver")
    if not (found and driver):
        raise SystemExit("error: no chromium with its chromedriver")
    options = webdriver.ChromeOptions()
    options.binary_location = found
    for switch in SWITCHES:
        options.add_argument(f"--{switch}")
    service = webdriver.ChromeService(executable_path=driver)
    return webdriver.Chrome(options=options, service=service)


def taken(browser, address, width, theme):
    """The upper part of a page as an image [SCREENS * SCREEN_PX, width]."""
    size = {"width": width, "height": SCREEN_PX, "deviceScaleFactor": 1}
    size["mobile"] = False
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    features = [{"name": "prefers-color-scheme", "value": theme}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    browser.get(address)
    WebDriverWait(browser, 20).until(lambda one: one.execute_script(READY))
    clip = {"x": 0, "y": 0, "width": width, "scale": 1}
    clip["height"] = int(SCREENS * SCREEN_PX)
    wanted = {"clip": clip, "captureBeyondViewport": True}
    picture = browser.execute_cdp_cmd("Page.captureScreenshot", wanted)
    return Image.open(io.BytesIO(base64.b64decode(picture["data"]))).convert("RGB")


def printed(folder):
    """The verdict of a scene's folder, as the last lines of its run say it."""
    lines = targets.verdicts([folder.name], results=folder.parent)
    shown = [line.replace(f"{folder.parent}/", "results/") for line in lines]
    return "\n".join(shown).strip("\n") + "\n"


if __name__ == "__main__":
    main()
