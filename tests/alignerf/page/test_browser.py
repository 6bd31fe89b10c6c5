"""The page in a real headless Chromium: no error; what is clicked or pressed."""

import json
import pathlib
import shutil
import urllib.parse

import pytest
from selenium import webdriver
from selenium.webdriver.common import keys
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select, WebDriverWait

from alignerf.page import told
from tools.docs import screenshot

WIDTHS = (1200, 380)
# The last two: as root, and where /dev/shm is small.
SWITCHES = ("headless=new", "disable-gpu", "no-sandbox", "disable-dev-shm-usage")


@pytest.fixture(scope="module")
def browser():
    found = shutil.which("chromium") or shutil.which("chromium-browser")
    driver = shutil.which("chromedriver")
    if not (found and driver):
        pytest.skip("no chromium with its chromedriver (packages of the distribution)")
    options = webdriver.ChromeOptions()
    options.binary_location = found
    for switch in SWITCHES:
        options.add_argument(f"--{switch}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(executable_path=driver)
    started = webdriver.Chrome(options=options, service=service)
    yield started
    started.quit()


def open_page(browser, results, text):
    """Open a page by its file's address, as a double click does."""
    path = results / "index.html"
    path.write_text(text, encoding="utf-8")
    browser.get_log("browser")
    browser.get("about:blank")
    browser.get(path.as_uri())
    WebDriverWait(browser, 10).until(
        lambda driver: driver.execute_script(screenshot.READY)
    )
    return path


@pytest.fixture
def opened(browser, render, results, causes):
    """The page of a verdict that has everything."""
    moved = ("aligned", results / "moved.npz")
    open_page(browser, results, render(moved=moved))
    return browser


def texts(browser, table, column):
    """A column of a table, from its top."""
    cells = browser.find_elements(
        By.CSS_SELECTOR, f"#{table} tbody tr td:nth-child({column})"
    )
    return [cell.text for cell in cells]


def position(browser):
    script = "return document.querySelector('#slider').value"
    return float(browser.execute_script(script))


def test_nothing_is_wrong_on_the_console_and_nothing_is_fetched(opened):
    assert opened.get_log("browser") == []
    script = "return performance.getEntriesByType('resource').map(e => e.name)"
    fetched = opened.execute_script(script)
    assert [name for name in fetched if not name.startswith("data:")] == []


def test_bars_end_where_their_numbers_lie(opened):
    script = """
    const ends = (bar) => {
      const whole = bar.getBoundingClientRect();
      return [...bar.children].map((one) => one.getBoundingClientRect())
        .map((one) => [one.left, one.right].map((x) => (x - whole.left) / whole.width));
    };
    return [...document.querySelectorAll(".bar-of")].map(ends);"""
    # Of both gains: from 0, from end to end of the interval, and the line at 0.
    db = [[0, 1.2, 0.9, 1.5, 0, 0], [-0.4, 0, -0.7, -0.1, 0, 0]]
    for bar, places in zip(opened.execute_script(script), db, strict=True):
        wanted = [(place + 0.7) / 2.2 for place in places]
        assert [end for one in bar for end in one] == pytest.approx(wanted, abs=0.01)


def test_it_opens_with_before_and_after_and_says_so(opened):
    layers = ("render", "render after round 1", "photo")
    shown = opened.find_elements(By.CSS_SELECTOR, "#panes img")
    for image, layer in zip(shown, layers, strict=True):
        assert image.get_attribute("naturalWidth") == "36"
        assert image.get_attribute("alt") == f"{layer} of 03"
    # The same part of each, where the difference is seen.
    assert len({*moves(opened)}) == 1
    assert "scale(2.5)" in moves(opened)[0]
    said = opened.find_element(By.ID, "caption").text
    assert "Left: render by base, before any fix, 6.0 px from the photo" in said
    assert "Right: render by base after round 1" in said


def test_the_command_is_that_of_the_trainer_that_is_chosen(opened):
    trainer = Select(opened.find_element(By.ID, "trainer"))
    for option in trainer.options:
        trainer.select_by_visible_text(option.text)
        shown = opened.find_elements(By.CSS_SELECTOR, "[data-trainer] code")
        (said,) = [one.text for one in shown if one.is_displayed()]
        place = "results/my scene/aligned/export/cameras"
        assert said == told.trainers(place)[option.text]


def test_the_slider_moves_by_keyboard_and_by_pointer(opened):
    opened.find_element(By.CSS_SELECTOR, "[data-mode=slide]").click()
    slider = opened.find_element(By.ID, "slider")
    before = position(opened)
    opened.execute_script("arguments[0].focus()", slider)
    chain = webdriver.ActionChains(opened).key_down(keys.Keys.ARROW_RIGHT)
    chain.pause(0.3).key_up(keys.Keys.ARROW_RIGHT).perform()
    assert position(opened) > before
    chain = webdriver.ActionChains(opened)
    chain.move_to_element_with_offset(slider, -100, 0).click_and_hold()
    chain.move_by_offset(-50, 0).release().perform()
    WebDriverWait(opened, 5).until(lambda driver: position(driver) < 45)


def test_another_photo_and_another_layer_are_shown(opened):
    first = opened.find_element(By.ID, "first").get_attribute("src")
    Select(opened.find_element(By.ID, "view")).select_by_value("test/01")
    assert opened.find_element(By.ID, "first").get_attribute("src") != first
    assert opened.current_url.endswith("#view=test%2F01")
    right = Select(opened.find_element(By.ID, "right"))
    right.select_by_value("flow after round 1")
    alt = opened.find_element(By.ID, "second").get_attribute("alt")
    assert alt == "flow after round 1 of 01"
    # A view that lacks the layer shows another; coming back shows it again.
    view = Select(opened.find_element(By.ID, "view"))
    view.select_by_value("train/05")
    assert right.first_selected_option.text == "render"
    view.select_by_value("test/01")
    assert right.first_selected_option.text == "flow after round 1"


def press(browser, key):
    webdriver.ActionChains(browser).send_keys(key).perform()


def alt_of_pane(browser):
    return browser.find_element(By.CSS_SELECTOR, "#panes img").get_attribute("alt")


def test_space_blinks_and_n_goes_to_the_next_photo(opened):
    press(opened, " ")
    assert not opened.find_element(By.ID, "slide").is_displayed()
    assert alt_of_pane(opened) == "render after round 1 of 03"
    press(opened, " ")
    assert alt_of_pane(opened) == "render of 03"
    press(opened, "n")
    assert alt_of_pane(opened) == "render of 01"
    press(opened, "p")
    assert alt_of_pane(opened) == "render of 03"
    # By itself it alternates until a key is pressed.
    opened.find_element(By.CSS_SELECTOR, "[data-mode=blink]").click()
    for name in ("render after round 1 of 03", "render of 03"):
        WebDriverWait(opened, 5, 0.05).until(lambda b, n=name: alt_of_pane(b) == n)
    opened.find_element(By.CSS_SELECTOR, "[data-mode=slide]").click()
    assert opened.find_element(By.ID, "slide").is_displayed()


def moves(browser):
    """How the pictures of all panes are moved."""
    script = (
        "return [...document.querySelectorAll('.moved')].map(e => e.style.transform)"
    )
    return browser.execute_script(script)


def test_panes_zoom_and_move_together(opened):
    opened.find_element(By.CSS_SELECTOR, "[data-mode=side]").click()
    assert len(moves(opened)) == 3
    names = opened.find_elements(By.CSS_SELECTOR, "#panes figcaption")
    assert [name.text for name in names] == [
        *("before any fix", "after round 1", "photo"),
    ]
    opened.find_element(By.CSS_SELECTOR, "#panes .stage").send_keys("++")
    first = moves(opened)
    assert len(set(first)) == 1
    assert "scale(2.25)" in first[0]
    stage = opened.find_elements(By.CSS_SELECTOR, "#panes .stage")[1]
    chain = webdriver.ActionChains(opened).move_to_element(stage).click_and_hold()
    chain.move_by_offset(40, 20).release().perform()
    second = moves(opened)
    assert len(set(second)) == 1
    assert second != first
    stage.send_keys("0")
    assert "scale(1)" in moves(opened)[0]


def test_crops_are_at_the_photos_own_size(browser, render, results, crops):
    open_page(browser, results, render(crops=crops, moved=("aligned", None)))
    Select(browser.find_element(By.ID, "view")).select_by_value("train/05")
    region = Select(browser.find_element(By.ID, "region"))
    assert len(region.options) == 3
    region.select_by_value("2")
    image = browser.find_element(By.ID, "first")
    WebDriverWait(browser, 5).until(lambda _: image.get_property("naturalWidth") == 8)
    Select(browser.find_element(By.ID, "right")).select_by_value("render, aligned")
    script = "return document.querySelector('#second').style.transform"
    moved = "translate(25%, -12.5%)"
    WebDriverWait(browser, 5).until(lambda b: b.execute_script(script) == moved)
    assert "full resolution" in browser.find_element(By.ID, "caption").text


def test_arrows_are_drawn_where_they_are_asked_for(opened):
    assert not opened.find_elements(By.CSS_SELECTOR, "#over path")
    opened.find_element(By.ID, "arrows").click()
    assert len(opened.find_elements(By.CSS_SELECTOR, "#over path")) == 2


@pytest.mark.parametrize("where", [".thumbs", ".strip", "#rig", "#views"])
def test_a_photo_is_opened_from_wherever_it_is_shown(opened, where):
    opened.execute_script(
        "document.querySelectorAll('details').forEach(d => d.open = 1)"
    )
    link = opened.find_element(By.CSS_SELECTOR, f"{where} a[href*='05']")
    if where == "#rig":
        link = link.find_element(By.CSS_SELECTOR, "circle")
    opened.execute_script("arguments[0].scrollIntoView()", link)
    webdriver.ActionChains(opened).move_to_element(link).click().perform()
    assert Select(
        opened.find_element(By.ID, "view")
    ).first_selected_option.text.startswith("05")
    assert "#view=train" in opened.current_url


def test_an_address_opens_its_photo(browser, render, results):
    path = open_page(browser, results, render())
    odd = urllib.parse.quote("test/<b>&'02", safe="")
    for address in (odd, urllib.parse.quote("<b>&'02")):
        browser.get("about:blank")
        browser.get(f"{path.as_uri()}#view={address}")
        chosen = Select(browser.find_element(By.ID, "view")).first_selected_option
        assert chosen.text == "<b>&'02"
    browser.get("about:blank")
    for other in ("#view=none", "#view=%", "#misalignment"):
        browser.get(f"{path.as_uri()}{other}")
        assert browser.get_log("browser") == []
    folded = browser.find_element(By.ID, "misalignment")
    assert folded.get_attribute("open")


def test_the_drawing_of_the_cameras_turns_and_has_arrows(browser, render, results):
    open_page(browser, results, render(moved=("aligned", results / "moved.npz")))
    drawing = browser.find_element(By.ID, "rig")
    paths = [
        path.get_attribute("d")
        for path in drawing.find_elements(By.CSS_SELECTOR, ".camera path")
    ]
    assert len(paths) == 5
    assert "NaN" not in "".join(paths)
    assert len(drawing.find_elements(By.CSS_SELECTOR, ".arrow")) == 2
    drawing.send_keys(keys.Keys.ARROW_RIGHT)
    again = drawing.find_element(By.CSS_SELECTOR, ".camera path").get_attribute("d")
    assert again != paths[0]


def test_a_summary_is_copied(opened):
    opened.execute_cdp_cmd(
        "Browser.grantPermissions",
        {"permissions": ["clipboardReadWrite", "clipboardSanitizedWrite"]},
    )
    button = opened.find_element(By.ID, "summary")
    button.click()
    WebDriverWait(opened, 5).until(lambda _: button.text == "Copied")
    copied = opened.execute_script("return navigator.clipboard.readText()")
    assert copied.startswith(
        "my scene: Misaligned by 2.3 px: poses are off.\nA < B & C."
    )


def test_tables_sort_by_number_and_back(opened):
    unfold(opened, "views")
    heading = opened.find_element(By.CSS_SELECTOR, "#views th:nth-child(3)")
    heading.click()
    in_order = ["18.00", "6.00", "1.00", "1.00", "0.20"]
    WebDriverWait(opened, 5).until(lambda d: texts(d, "views", 3) == in_order)
    heading.send_keys(keys.Keys.ENTER)
    WebDriverWait(opened, 5).until(lambda d: texts(d, "views", 3) == in_order[::-1])


def unfold(browser, name):
    browser.find_element(By.CSS_SELECTOR, f"#{name} summary").click()


def test_a_portrait_photo_stands_upright(browser, render, results):
    poses = json.loads((results / "poses.json").read_text())
    poses["quarter_turns"] = {"03": 1}
    (results / "poses.json").write_text(json.dumps(poses))
    open_page(browser, results, render())
    sizes = [
        (image.get_attribute("naturalWidth"), image.get_attribute("naturalHeight"))
        for image in (browser.find_element(By.ID, name) for name in ("first", "second"))
    ]
    assert sizes == [("24", "36")] * 2


def test_on_paper_both_pictures_stand_beside_each_other(opened):
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    shown = {
        name: opened.find_element(By.CSS_SELECTOR, name).is_displayed()
        for name in ("#print-left", "#print-right", "#slider", "nav", ".thumbs", "#rig")
    }
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    hidden = ("#slider", "nav")
    assert shown == {name: name not in hidden for name in shown}


@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_is_wider_than_the_window(opened, width):
    opened.set_window_size(width, 800)
    script = "return document.documentElement.scrollWidth - window.innerWidth"
    assert opened.execute_script(script) <= 0


def test_the_page_is_dark_where_that_is_asked_for(opened):
    def back():
        script = "return getComputedStyle(document.body).backgroundColor"
        return opened.execute_script(script)

    light = back()
    feature = [{"name": "prefers-color-scheme", "value": "dark"}]
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": feature})
    dark = back()
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    assert (light, dark) == ("rgb(255, 255, 255)", "rgb(21, 24, 28)")


def test_its_links_open(opened, results):
    unfold(opened, "downloads")
    for link in opened.find_elements(By.CSS_SELECTOR, "#downloads a"):
        path = pathlib.Path(results, link.text)
        assert path.is_file()
        assert link.get_attribute("href") == path.as_uri()
