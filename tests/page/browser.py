"""A headless Chromium."""

import json
import tempfile
from pathlib import Path

from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By

from server import eventually

FLAGS = ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-dev-shm-usage",
         "--disable-background-networking", "--disable-component-update", "--disable-sync", "--hide-scrollbars",
         "--js-flags=--expose-gc", "--enable-precise-memory-info"]


class Browser:
    def __init__(self):
        options = Options()
        for flag in [*FLAGS, f"--user-data-dir={tempfile.mkdtemp()}"]:
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
        options.binary_location = "/usr/bin/chromium"
        self.driver = webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)
        self.driver.set_page_load_timeout(30)
        self.downloads = Path(tempfile.mkdtemp())
        self.command("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(self.downloads))
        self.size(1440, 900)

    def command(self, name, **parameters):
        return self.driver.execute_cdp_cmd(name, parameters)

    def size(self, width, height, scale=1):
        self.command("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale,
                     mobile=False)

    def scheme(self, name):
        """Sets the system's scheme: light or dark."""
        self.command("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": name}])

    def open(self, url):
        self.driver.get("about:blank")
        self.driver.get(url)

    def run(self, script, *arguments):
        return self.driver.execute_script(script, *arguments)

    def find(self, selector):
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def all(self, selector):
        return self.driver.find_elements(By.CSS_SELECTOR, selector)

    def text(self, selector):
        """The text of an element, visible or not; None without the element."""
        return self.run("return document.querySelector(arguments[0])?.textContent", selector)

    def wait(self, script, *arguments):
        """Waits until the script returns a true value."""
        return eventually(lambda: self.run(script, *arguments), script)

    def wait_text(self, selector, part):
        return eventually(lambda: part in (self.text(selector) or ""), lambda: f"{part!r} in {selector}: {self.text(selector)!r}")

    def rows(self):
        """Cells of the visible rows, by class."""
        return self.run("""
            return [...document.querySelectorAll('.job-row:not([hidden])')].map((row) => Object.fromEntries(
              [['job', row.dataset.job], ...[...row.children].map((cell) => [cell.classList[0], cell.textContent])]))""")

    def screenshot(self, path):
        self.driver.save_screenshot(str(path))

    def complaints(self):
        """Errors and warnings of the console."""
        return [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]

    def requested(self):
        """Every URL requested since the last call."""
        urls = []
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                urls.append(message["params"]["request"]["url"])
        return urls

    def close(self):
        self.driver.quit()
