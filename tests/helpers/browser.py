"""A page in headless Chromium, driven by playwright: no network, and Debian's browser where there is one."""

import shutil
from pathlib import Path
from typing import Any

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
CHROMIUM = next(filter(None, map(shutil.which, NAMES)), None)
try:
    from playwright.sync_api import sync_playwright
except ImportError:
    sync_playwright = None  # type: ignore[assignment]
#: Why pages cannot be shown here; empty where they can.
MISSING = (
    f"no Chromium is installed; looked for {', '.join(NAMES)}" if CHROMIUM is None
    else "playwright is not installed" if sync_playwright is None
    else ""
)  # fmt: skip
needs_chromium = pytest.mark.skipif(bool(MISSING), reason=MISSING)
#: Longest wait for an answer, ms: long enough for a machine that is busy with much else.
LIMIT = 180_000.0


class Browser:
    """A running Chromium."""

    def __init__(self) -> None:
        self._playwright = sync_playwright().start()
        self._browser = self._playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])

    def close(self) -> None:
        """End it."""
        self._browser.close()
        self._playwright.stop()

    def page(self, width: int, dark: bool) -> Any:
        """An empty page of a width, CSS px."""
        context = self._browser.new_context(
            viewport={"width": width, "height": 900}, color_scheme="dark" if dark else "light",
            is_mobile=width < 600, offline=True,
        )  # fmt: skip
        context.set_default_timeout(LIMIT)
        return context.new_page()


class Tab:
    """A page that is shown.

    Parameters
    ----------
    browser : Browser
    page : Path
        The file shown.
    width : int
        Of the window, CSS px.
    dark : bool
        Whether the reader prefers dark colours.
    """

    def __init__(self, browser: Browser, page: Path, width: int = 1200, dark: bool = False) -> None:
        self.shown = browser.page(width, dark)
        #: Exceptions, errors and warnings of the page, and requests for anything that is not a file.
        self.wrong: list[str] = []
        self.shown.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.shown.on("console", self._said)
        self.shown.on("request", self._asked)
        self.shown.goto(page.resolve().as_uri(), timeout=LIMIT)

    def run(self, script: str) -> Any:
        """What a script returns: the body of an asynchronous function."""
        return self.shown.evaluate(f"(async () => {{ {script} }})()")

    def mouse(self, kind: str, x: float, y: float) -> None:
        """Press, move or release the left button at a place."""
        self.shown.mouse.move(x, y)
        match kind:
            case "mousePressed":
                self.shown.mouse.down()
            case "mouseReleased":
                self.shown.mouse.up()
            case "mouseMoved":
                pass
            case _:
                raise ValueError(kind)

    def click(self, element: str) -> None:
        """Click what an expression gives, in its middle, with the mouse."""
        x, y = self.run(
            f"const e = {element}; e.scrollIntoView({{block: 'center', inline: 'center'}});"
            "const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2];"
        )
        self.mouse("mousePressed", x, y)
        self.mouse("mouseReleased", x, y)

    def close(self) -> None:
        """Leave the page."""
        self.shown.context.close()

    def _said(self, message: Any) -> None:
        if message.type in ("error", "warning", "assert"):
            self.wrong.append(message.text)

    def _asked(self, request: Any) -> None:
        if not request.url.startswith(("file:", "data:")):
            self.wrong.append(f"request: {request.url}")
