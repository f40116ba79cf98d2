"""Compiles the catalogue of reasons into what is built; everything else stands in pyproject.toml."""

import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "schemas" / "reasons"))
from compiled import compile_languages  # noqa: E402


class BuildWithLanguages(build_py):
    def run(self) -> None:
        languages = HERE / "schemas" / "reasons" / "languages"
        compile_languages(languages, languages)
        super().run()


setup(cmdclass={"build_py": BuildWithLanguages})
