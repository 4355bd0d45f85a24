"""Take the README's picture of the page: `python tests/browser/screenshot.py [--phone] [--dark] [FILE]`.

It starts the demo with two counters beside the default, waits until some thirty steps are counted and the plot is
full, and writes a PNG of at most MOST_BYTES.
"""

import argparse
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from browser.commands import running  # noqa: E402  # found only once the path is set
from browser.launch import running_browser  # noqa: E402
from playwright.sync_api import ViewportSize  # noqa: E402

STEPS = 30
MOST_BYTES = 150_000
DESKTOP: ViewportSize = {"width": 1280, "height": 800}
PHONE: ViewportSize = {"width": 390, "height": 844}


def main() -> int:
    """Write the picture; return 1 where it is too large."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", nargs="?", type=Path, default=HERE / "page.png", metavar="FILE")
    parser.add_argument("--phone", action="store_true", help="390 × 844 instead of 1280 × 800")
    parser.add_argument("--dark", action="store_true", help="the dark theme")
    options = parser.parse_args()
    beside = ("--beside", "double_threshold", "--beside", "adaptive_peak")
    with running("demo", "--port", "0", *beside, says=r"http://\S+/") as (_, url), running_browser() as browser:
        page = browser.new_page(
            viewport=PHONE if options.phone else DESKTOP,
            color_scheme="dark" if options.dark else "light",
            locale="en-GB",
            timezone_id="Europe/Zurich",
        )
        page.goto(url)
        page.wait_for_function(
            "steps => Number(document.querySelector('[data-f=steps]')?.textContent) >= steps", arg=STEPS, timeout=90_000
        )
        page.screenshot(path=options.file)
    size = options.file.stat().st_size
    print(f"{options.file}: {size} bytes")
    return int(size > MOST_BYTES)


if __name__ == "__main__":
    sys.exit(main())
