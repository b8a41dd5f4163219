"""The interactive page, in a browser: a slider is moved, and the numbers follow."""

import importlib.util
import re
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[1] / "notebooks" / "live" / "suspension.py"
needed = ("marimo", "plotly", "selenium")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
WAIT = 60.0  # s that a page may take to start on a busy machine


def _free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


@pytest.fixture(scope="module")
def address():
    """The page, served as `marimo run` does, until the tests end."""
    missing = [name for name in needed if importlib.util.find_spec(name) is None]
    if missing or CHROMIUM is None or DRIVER is None:
        pytest.skip(f"needs a browser with its driver, and {', '.join(missing) or 'nothing else'}")
    port = _free_port()
    words = [
        sys.executable,
        "-m",
        "marimo",
        "-q",
        "-y",
        "run",
        str(PAGE),
        "--headless",
        "--no-token",
        "--port",
        str(port),
    ]
    server = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=PAGE.parents[2])
    try:
        ends = time.monotonic() + WAIT
        while time.monotonic() < ends:
            with socket.socket() as tried:
                if tried.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.1)
        yield f"http://127.0.0.1:{port}"
    finally:
        server.terminate()
        server.wait(WAIT)


@pytest.fixture
def browser():
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for word in (
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        "--window-size=1400,1100",
    ):
        options.add_argument(word)
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    yield driver
    driver.quit()


def _numbers(text):
    """Return the page's numbers by label: a number stands below its label."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    labels = ("verified norm of the loop", "disk margin, alpha", "deposit CV, controlled", "computed in")
    return {
        label: float(re.match(r"[\d.e+-]+", lines[lines.index(label) + 1])[0])
        for label in labels
        if label in lines[:-1]
    }


def _awaited(browser, what):
    from selenium.webdriver.common.by import By

    ends, text = time.monotonic() + WAIT, ""
    while time.monotonic() < ends:
        text = browser.find_element(By.TAG_NAME, "body").text
        numbers = _numbers(text)
        if len(numbers) == 4 and what(numbers):
            return numbers
        time.sleep(0.1)
    raise AssertionError(f"the page shows, after {WAIT:g} s: {text[-2000:]}")


@pytest.mark.slow
def test_a_slider_moves_the_numbers(address, browser, tmp_path):
    from selenium.webdriver.common.keys import Keys

    browser.get(address)
    before = _awaited(browser, lambda numbers: True)
    find = "return document.querySelectorAll('marimo-slider')[{}].shadowRoot.querySelector('[role=slider]')"
    tips = browser.execute_script(find.format(1))
    assert tips.get_attribute("aria-valuenow") is not None
    for _ in range(10):
        tips.send_keys(Keys.ARROW_RIGHT)  # more weight on the tips
    norm, spray, margin = "verified norm of the loop", "deposit CV, controlled", "disk margin, alpha"

    def moved(numbers):  # what weighs more costs more; positions that the slider passes may show first
        change = {label: numbers[label] / before[label] - 1.0 for label in before}
        return change[norm] > 0.2 and abs(change[spray]) > 0.1 and abs(change[margin]) > 0.1

    _awaited(browser, moved)
    browser.save_screenshot(str(tmp_path / "page.png"))
    assert (tmp_path / "page.png").stat().st_size > 30_000


@pytest.mark.slow
def test_the_page_computes_again_and_draws_what_it_says():
    """Without a browser: its cells, run once to load what they need, and once again."""
    pytest.importorskip("marimo")
    pytest.importorskip("plotly")
    spec = importlib.util.spec_from_file_location("suspension", PAGE)
    page = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(page)
    page.app.run()
    shown, found = page.app.run()
    assert found["active"].certified
    assert found["spray"].cv < found["passive_spray"].cv
    first = next(each for each in shown if each is not None)
    assert first.text.startswith("<span"), "the page begins with its words"
    assert "live" in first.text
    figure = shown[-1]
    curves = {trace.name: trace.y.max() for trace in figure.data if trace.name}
    assert curves["passive"] == pytest.approx(found["passive"].peak, rel=1e-6)  # the curve reaches the peak beside it
    assert curves["controlled"] == pytest.approx(found["active"].peak, rel=1e-6)
    titles = [figure.layout[key].title.text for key in figure.layout if key.startswith(("xaxis", "yaxis"))]
    assert len(titles) == 8
    assert all(title.endswith("]") for title in titles), titles
