# SPDX-License-Identifier: Apache-2.0
"""A hook of MkDocs: what stands outside docs/ becomes part of the site where it is a page or one links to it.

A link is written as GitHub reads it, relative to the file that it is in. Here a document of `PAGES` becomes a page
below project/, and any other file is copied there as it is. README.md is the site's first page.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

PAGES = (".github/SECURITY.md", "ARCHITECTURE.md", "CHANGELOG.md", "QUALITY_DECLARATION.md", "models/README.md")
OUTSIDE = "project"  # where the site has what stands outside docs/
INSTEAD = {"README.md": "docs/index.md"}  # what has a page of its own for the site
GITHUB = ".github/"  # of a name with a dot MkDocs makes no page
OF_GITHUB = {name.removeprefix(GITHUB): name for name in PAGES if name.startswith(GITHUB)}
LINK = re.compile(r"(?<=\]\()(?!\w+:|#)([^)\s#]+)(?=[)#])")
FENCED = re.compile(r"(```.*?```)", re.DOTALL)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the documents outside docs/, and what the documents link to."""
    root = Path(config.config_file_path).parent
    for name in PAGES:
        _add(files, config, name)
    for file in list(files.documentation_pages()):
        here = in_repository(file.src_uri)
        for link in links(file.content_string):
            name = target(here, link)
            if not name.startswith("docs/") and (root / name).is_file():
                _add(files, config, name)
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """The page with its links led to where the site has their targets."""
    here, there = in_repository(page.file.src_uri), posixpath.dirname(page.file.src_uri)

    def led(match: re.Match[str]) -> str:
        return posixpath.relpath(in_site(target(here, match[1])), there or ".")

    return "".join(part if part.startswith("```") else LINK.sub(led, part) for part in FENCED.split(markdown))


def links(markdown: str) -> list[str]:
    """The files that a document links to, as it names them."""
    return LINK.findall(FENCED.sub("", markdown))


def target(here: str, link: str) -> str:
    """The path in the repository that ``link`` in the file ``here`` of the repository leads to."""
    name = posixpath.normpath(posixpath.join(posixpath.dirname(here), link))
    return INSTEAD.get(name, name)


def in_repository(src_uri: str) -> str:
    """Where the repository has what the site has at ``src_uri``."""
    head, _, rest = src_uri.partition("/")
    return OF_GITHUB.get(rest, rest) if head == OUTSIDE else f"docs/{src_uri}"


def in_site(name: str) -> str:
    """Where the site has a file of the repository."""
    return name.removeprefix("docs/") if name.startswith("docs/") else f"{OUTSIDE}/{name.removeprefix(GITHUB)}"


def _add(files: Files, config: MkDocsConfig, name: str) -> None:
    if files.get_file_from_path(in_site(name)) is None:
        root = Path(config.config_file_path).parent
        files.append(File.generated(config, in_site(name), abs_src_path=str(root / name)))
