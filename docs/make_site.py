"""Lays out the pages of the site for `make docs`: `python docs/make_site.py FOLDER` writes FOLDER/en and FOLDER/es.

Every page of the repository, and whatever it links to: pictures, and source files and folders, each of which becomes a
page of its own. So each link that works in the repository works on the site.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).resolve().parents[1]
SPANISH = PurePosixPath("docs/es")
PAGES = (
    "*.md",
    "docs/**/*.md",
    "deploy/*.md",
    "firmware/*.md",
    "firmware/tests/*.md",
    "services/**/*.md",
    "urdf/*/*.md",
)
HOMES = {"README.md": "en", "README.es.md": "es"}
PICTURES = {".png", ".gif", ".svg"}
CODE = {".py": "python", ".toml": "toml", ".cpp": "cpp", ".h": "cpp", ".yaml": "yaml", ".sh": "bash", ".xml": "xml"}
FENCED = re.compile(r"(^ *```.*?^ *```)", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\[([^\[\]]*)\]\(([^)#\s]*)((?:#[^)\s]*)?)\)")


class BrokenLink(Exception):
    """A page links to what is not there; the text names both."""


@dataclass
class Site:
    """The pages below `root`, the repository, and what of them has been laid out below `out`."""

    root: Path
    out: Path
    laid: set[PurePosixPath] = field(default_factory=set)

    def lay_out(self) -> None:
        """All pages; raises BrokenLink."""
        for pattern in (*HOMES, *PAGES):
            for page in sorted(self.root.glob(pattern)):
                self.add(PurePosixPath(page.relative_to(self.root).as_posix()))

    def add(self, path: PurePosixPath) -> None:
        """A page, file or folder of the repository in its own language, and what it links to."""
        if path in self.laid:
            return
        self.laid.add(path)
        text = self._text(path)
        language = language_of(path)
        other: list[str] = []

        def follow(link: re.Match[str]) -> str:
            words, target, fragment = link.groups()
            if not target or "://" in target or target.startswith("mailto:"):
                return link[0]
            linked = self._resolved(path, target)
            place = self._place_of(linked, language)
            if language_of(linked) != language and linked.suffix not in PICTURES:
                other.append(relative(place.with_suffix(".html"), html_of(path)))
                return f'<a href="{other[-1]}{fragment}">{words}</a>'  # of another build, which mkdocs does not know
            return f"[{words}]({relative(place, page_of(path))}{fragment})"

        parts = FENCED.split(text)
        parts[::2] = [LINK.sub(follow, part) for part in parts[::2]]
        is_source = str(path.suffix != ".md").lower()
        head = f"---\ncounterpart: {other[0] if other else ''}\nsearch: {{exclude: {is_source}}}\n---\n\n"
        self._write(page_of(path), head + "".join(parts))

    def _place_of(self, linked: PurePosixPath, language: str) -> PurePosixPath:
        """Where the site has it: a picture beside the pages that show it, all else in its own language."""
        if linked.suffix not in PICTURES:
            self.add(linked)
            return page_of(linked)
        place = PurePosixPath(language) / "pictures" / linked.name
        target = self.out / place
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(self.root / linked, target)
        return place

    def _resolved(self, page: PurePosixPath, target: str) -> PurePosixPath:
        """From the repository's root, a folder's README in its place."""
        path = PurePosixPath(os.path.normpath(page.parent / target))
        real = self.root / path
        if not real.exists() or path.parts[0] == "..":
            raise BrokenLink(f"{page} links to {target}, and there is no {path}")
        return path / "README.md" if (real / "README.md").is_file() else path

    def _text(self, path: PurePosixPath) -> str:
        """The page, or one that shows the source file or lists the folder."""
        real = self.root / path
        if real.is_dir():
            names = sorted(each.name for each in real.iterdir() if each.is_file() and each.name[0] not in "._")
            return "\n".join([f"# {path}/", "", *(f"- [{name}]({path.name}/{name})" for name in names)])
        text = real.read_text(encoding="utf-8")
        if path.suffix == ".md":
            return text
        return f"# {path.name}\n\n`{path}`\n\n````{CODE.get(path.suffix, 'text')}\n{text}````\n"

    def _write(self, place: PurePosixPath, text: str) -> None:
        target = self.out / place
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")


def language_of(path: PurePosixPath) -> str:
    return HOMES.get(str(path), "es" if path.is_relative_to(SPANISH) else "en")


def page_of(path: PurePosixPath) -> PurePosixPath:
    """Where a page, source file or folder of the repository stands below the two languages."""
    language = PurePosixPath(language_of(path))
    if str(path) in HOMES:
        return language / "index.md"
    if path.suffix == ".md":
        base = SPANISH if path.is_relative_to(SPANISH) else SPANISH.parent
        inner = path.relative_to(base) if path.is_relative_to(base) else path
        return language / inner.with_name(inner.name.replace("README", "index"))
    return language / "source" / path.with_name(f"{path.name}.md")


def html_of(path: PurePosixPath) -> PurePosixPath:
    return page_of(path).with_suffix(".html")


def relative(target: PurePosixPath, page: PurePosixPath) -> str:
    return PurePosixPath(os.path.relpath(target, page.parent)).as_posix()


def main(out: Path) -> None:
    shutil.rmtree(out, ignore_errors=True)
    try:
        Site(ROOT, out).lay_out()
    except BrokenLink as error:
        sys.exit(f"docs: {error}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
