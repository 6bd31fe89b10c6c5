"""The page in a real headless Chromium: no error, the slider moves, tables sort."""

import json
import pathlib
import shutil

import pytest
from selenium import webdriver
from selenium.webdriver.common import keys
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select, WebDriverWait

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
    for switch in (
        "headless=new",
        "no-sandbox",
        "disable-gpu",
        "disable-dev-shm-usage",
    ):
        options.add_argument(f"--{switch}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(executable_path=driver)
    started = webdriver.Chrome(options=options, service=service)
    yield started
    started.quit()


@pytest.fixture
def opened(browser, render, results):
    """The page, opened by its file's address as a double click does."""
    path = results / "index.html"
    path.write_text(render(), encoding="utf-8")
    browser.get_log("browser")
    browser.get(path.as_uri())
    ready = "return document.querySelector('#slider').classList.contains('rendered')"
    WebDriverWait(browser, 10).until(lambda driver: driver.execute_script(ready))
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


def test_both_images_are_there_and_say_what_they_show(opened):
    for place, layer in (("first", "photo"), ("second", "render")):
        image = opened.find_element(By.ID, place)
        assert image.get_attribute("naturalWidth") == "36"
        assert image.get_attribute("alt") == f"{layer} of view train/05"


def test_the_slider_moves_by_keyboard_and_by_pointer(opened):
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


def test_another_view_and_another_layer_are_shown(opened):
    first = opened.find_element(By.ID, "first").get_attribute("src")
    Select(opened.find_element(By.ID, "view")).select_by_value("test/03")
    assert opened.find_element(By.ID, "first").get_attribute("src") != first
    right = Select(opened.find_element(By.ID, "right"))
    right.select_by_value("flow after round 1")
    alt = opened.find_element(By.ID, "second").get_attribute("alt")
    assert alt == "flow after round 1 of view test/03"
    assert (
        "held out: 3.00 px of the training size apart"
        in opened.find_element(By.ID, "note").text
    )
    # A view that lacks the layer shows the first; coming back shows it again.
    view = Select(opened.find_element(By.ID, "view"))
    view.select_by_value("train/05")
    assert right.first_selected_option.text == "photo"
    view.select_by_value("test/03")
    assert right.first_selected_option.text == "flow after round 1"


def test_tables_sort_by_number_and_back(opened):
    heading = opened.find_element(By.CSS_SELECTOR, "#views th:nth-child(3)")
    heading.click()
    in_order = ["9.00", "3.00", "0.50", "0.50", "0.10"]
    WebDriverWait(opened, 5).until(lambda d: texts(d, "views", 3) == in_order)
    heading.send_keys(keys.Keys.ENTER)
    WebDriverWait(opened, 5).until(lambda d: texts(d, "views", 3) == in_order[::-1])


def test_a_view_of_the_table_leads_to_its_images(opened):
    (link,) = [
        link
        for link in opened.find_elements(By.CSS_SELECTOR, "#views td a")
        if link.text == "03"
    ]
    link.click()
    chosen = Select(opened.find_element(By.ID, "view")).first_selected_option
    assert chosen.get_attribute("value") == "test/03"


def test_a_view_on_its_side_is_shown_upright(browser, render, results):
    poses = json.loads((results / "poses.json").read_text())
    poses["quarter_turns"] = {"05": 1}
    (results / "poses.json").write_text(json.dumps(poses))
    (results / "index.html").write_text(render(), encoding="utf-8")
    browser.get((results / "index.html").as_uri())
    sizes = [
        (image.get_attribute("naturalWidth"), image.get_attribute("naturalHeight"))
        for image in (browser.find_element(By.ID, name) for name in ("first", "second"))
    ]
    assert sizes == [("24", "36")] * 2


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
    for link in opened.find_elements(By.CSS_SELECTOR, "#downloads a"):
        path = pathlib.Path(results, link.text)
        assert path.is_file()
        assert link.get_attribute("href") == path.as_uri()
