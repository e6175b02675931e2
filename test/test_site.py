# SPDX-License-Identifier: Apache-2.0
"""The site of the documentation builds, loads nothing from elsewhere, and none of its links leads nowhere."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from report.chromium import chromium

NO_NETWORK = dict.fromkeys(("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"), "http://127.0.0.1:9")
TELEPHONE = {"width": 420, "height": 900, "deviceScaleFactor": 1, "mobile": True}
LOADED = re.compile(r'<(?:script|img|link|iframe)\b[^>]*?\b(?:src|href)="(?:https?:)?//[^"]*"')


def build(config: Path, out: Path) -> subprocess.CompletedProcess[str]:
    """What `mkdocs build --strict` says of a site whose proxy answers nobody."""
    pytest.importorskip("mkdocstrings_handlers.python", reason="the extra docs is not installed")
    pytest.importorskip("material", reason="the extra docs is not installed")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", str(config), "-d", str(out)]
    environment = {**os.environ, **NO_NETWORK, "NO_MKDOCS_2_WARNING": "1"}
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=240, check=False)


@pytest.fixture(scope="module")
def site(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the built site."""
    out = tmp_path_factory.mktemp("site")
    done = build(repository / "mkdocs.yml", out)
    assert done.returncode == 0, done.stderr
    return out


def test_the_site_builds_without_network_and_without_dead_links_or_anchors(site: Path) -> None:
    assert {"index.html", "troubleshooting.html", "wire.html", "search"} <= {path.name for path in site.iterdir()}
    assert len(list(site.rglob("*.html"))) >= 20


def test_no_page_loads_anything_from_elsewhere(site: Path) -> None:
    loading = {page.name: LOADED.findall(page.read_text(encoding="utf-8")) for page in site.rglob("*.html")}
    assert not {name: found for name, found in loading.items() if found}


def test_what_stands_outside_the_documents_is_part_of_the_site(site: Path) -> None:
    assert 'href="project/ARCHITECTURE.html"' in (site / "gate.html").read_text(encoding="utf-8")
    assert (site / "project/config/covariance.yaml").is_file()
    assert (site / "project/CHANGELOG.html").is_file()


def test_the_docstrings_are_pages(site: Path) -> None:
    library = (site / "api/library.html").read_text(encoding="utf-8")
    assert "objreg_ros.library.register_clouds" in library and "Lay two RGB-D pictures of one camera" in library
    data = (site / "api/data.html").read_text(encoding="utf-8")
    names = ("closures.LoopClosure", "closures.Rejected", "closures.Reason", "frames.Frame", "images.Intrinsics")
    assert all(f'id="objreg_ros.data.{name}"' in data for name in names)
    assert "T_target_source" in (site / "api/registrar.html").read_text(encoding="utf-8")
    assert 'id="objreg_mapper.pose_graph.PoseGraph"' in (site / "api/pose-graph.html").read_text(encoding="utf-8")


def test_a_link_that_leads_nowhere_ends_the_build(repository: Path, tmp_path: Path) -> None:
    docs = tmp_path / "docs"
    docs.mkdir()
    shutil.copy(repository / "docs/links.py", docs)
    (docs / "index.md").write_text("# A page\n\n[one](#a-page) [two](#nowhere) [three](gone.md)\n")
    settings = (repository / "mkdocs.yml").read_text(encoding="utf-8")
    validation = re.search(r"^validation:\n(?:  .*\n)+", settings, re.MULTILINE)
    assert validation is not None
    config = tmp_path / "mkdocs.yml"
    config.write_text(f"site_name: none\n{validation[0]}nav: [index.md]\n")
    done = build(config, tmp_path / "out")
    assert done.returncode != 0 and "#nowhere" in done.stderr and "gone.md" in done.stderr
    assert "#a-page" not in done.stderr


def test_the_search_finds_pages_that_are_read_without_a_server_and_no_table_is_wider_than_a_telephone(
    site: Path,
) -> None:
    with chromium("--hide-scrollbars", "--window-size=1280,900") as browser:
        browser.get((site / "index.html").as_uri())
        browser.find_element("css selector", "[data-md-component=search-query]").send_keys("covariance")
        wait_for(lambda: browser.execute_script("return document.querySelectorAll('.md-search-result__item').length"))
        assert not browser.get_log("browser")
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", TELEPHONE)
        for name in ("index", "wire", "parameters", "figures"):
            browser.get((site / f"{name}.html").as_uri())
            wait_for(lambda: browser.execute_script("return document.readyState === 'complete'"))
            assert browser.execute_script("return document.documentElement.scrollWidth") <= TELEPHONE["width"], name


def wait_for(done: Callable[[], object], seconds: float = 30.0) -> None:
    deadline = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < deadline
        time.sleep(0.1)
