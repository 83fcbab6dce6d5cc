"""A page in headless Chromium, driven by its DevTools protocol over a pair of pipes: no network, no other package.

Protocol: https://chromedevtools.github.io/devtools-protocol/ (messages as JSON, each ended by a zero byte).
"""

import json
import os
import select
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
CHROMIUM = next(filter(None, map(shutil.which, NAMES)), None)
#: Longest wait for an answer, s: long enough for a machine that is busy with much else.
LIMIT = 180.0
FLAGS = (
    "--headless", "--remote-debugging-pipe", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
    "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--disable-extensions", "--hide-scrollbars",
)  # fmt: skip
#: Chromium reads descriptor 3 and writes descriptor 4: what becomes Chromium puts them there.
BEGIN = """
import fcntl, os, sys
high = [fcntl.fcntl(int(end), fcntl.F_DUPFD, 10) for end in sys.argv[1:3]]
os.dup2(high[0], 3)
os.dup2(high[1], 4)
os.execv(sys.argv[3], sys.argv[3:])
"""


class Browser:
    """A running Chromium.

    Parameters
    ----------
    scratch : Path
        Directory for its profile.
    """

    def __init__(self, scratch: Path) -> None:
        its_in, self._out = os.pipe()
        self._in, its_out = os.pipe()
        words = [str(CHROMIUM), *FLAGS, f"--user-data-dir={scratch}", "about:blank"]
        self._process = subprocess.Popen(
            [sys.executable, "-ISc", BEGIN, str(its_in), str(its_out), *words], pass_fds=(its_in, its_out),
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(its_in)
        os.close(its_out)
        self._rest, self._count = b"", 0
        self.events: list[Mapping[str, Any]] = []

    def close(self) -> None:
        """End it."""
        try:
            self.call("Browser.close")
            self._process.wait(LIMIT)
        finally:
            self._process.kill()
            self._process.wait()
            os.close(self._in)
            os.close(self._out)

    def call(self, method: str, session: str = "", **parameters: Any) -> Mapping[str, Any]:
        """The result of a method of the protocol; events that come before it are kept."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": parameters} | (
            {"sessionId": session} if session else {}
        )
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._out, data) :]
        deadline = time.monotonic() + LIMIT
        while True:
            answer = self._next(deadline)
            if answer.get("id") == self._count:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]
            self.events.append(answer)

    def wait_for(self, method: str, session: str) -> None:
        """Read events until one comes, if it has not come yet."""
        deadline = time.monotonic() + LIMIT
        while not any(e.get("method") == method and e.get("sessionId") == session for e in self.events):
            self.events.append(self._next(deadline))

    def _next(self, deadline: float) -> Mapping[str, Any]:
        while b"\0" not in self._rest:
            if not select.select([self._in], [], [], max(0.0, deadline - time.monotonic()))[0]:
                raise TimeoutError(f"{CHROMIUM} said nothing for {LIMIT:g} s")
            found = os.read(self._in, 1 << 20)
            if not found:
                raise ConnectionError(f"{CHROMIUM} has ended with code {self._process.wait()}")
            self._rest += found
        message, self._rest = self._rest.split(b"\0", 1)
        return json.loads(message)  # type: ignore[no-any-return]


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
        self._browser = browser
        target = browser.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=900,
            deviceScaleFactor=1,
            mobile=width < 600,
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        self.call("Page.navigate", url=page.resolve().as_uri())
        browser.wait_for("Page.loadEventFired", self._session)

    def call(self, method: str, **parameters: Any) -> Mapping[str, Any]:
        """A method of the protocol, for this page."""
        return self._browser.call(method, self._session, **parameters)

    def run(self, script: str) -> Any:
        """What a script returns: the body of an asynchronous function."""
        answer = self.call(
            "Runtime.evaluate",
            expression=f"(async () => {{ {script} }})()",
            awaitPromise=True,
            returnByValue=True,
        )
        if "exceptionDetails" in answer:
            raise RuntimeError(str(answer["exceptionDetails"]))
        return answer["result"].get("value")

    def mouse(self, kind: str, x: float, y: float) -> None:
        """Press, move or release the left button at a place."""
        self.call(
            "Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=int(kind != "mouseReleased"),
            clickCount=1,
        )  # fmt: skip

    def click(self, element: str) -> None:
        """Click what an expression gives, in its middle, with the mouse."""
        x, y = self.run(
            f"const e = {element}; e.scrollIntoView({{block: 'center'}}); const b = e.getBoundingClientRect();"
            "return [b.x + b.width / 2, b.y + b.height / 2];"
        )
        self.mouse("mousePressed", x, y)
        self.mouse("mouseReleased", x, y)

    @property
    def wrong(self) -> list[str]:
        """Exceptions, errors and warnings of the page, and requests for anything that is not a file."""
        said = []
        for event in self._browser.events:
            if event.get("sessionId") != self._session:
                continue
            about = event["params"]
            match event["method"]:
                case "Runtime.exceptionThrown":
                    said.append(about["exceptionDetails"]["exception"].get("description", str(about)))
                case "Runtime.consoleAPICalled" if about["type"] in ("error", "warning", "assert"):
                    said.append(" ".join(str(a.get("value", a)) for a in about["args"]))
                case "Log.entryAdded" if about["entry"]["level"] in ("error", "warning"):
                    said.append(f"{about['entry']['text']} {about['entry'].get('url', '')}")
                case "Network.requestWillBeSent" if not about["request"]["url"].startswith(
                    ("file:", "data:")
                ):
                    said.append(f"request: {about['request']['url']}")
        return said
