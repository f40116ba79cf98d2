"""The language of the locale, of those that the catalogue has."""

from __future__ import annotations

from collections.abc import Mapping

ENGLISH = "en"
VARIABLES = ("LC_ALL", "LC_MESSAGES", "LANG")  # the first that is set decides, as POSIX has it


def known() -> tuple[str, ...]:
    """The languages that there are."""
    from gemelo.schemas.reasons.catalogue import languages  # 30 ms, for another language than English alone

    return languages()


def of_environment(environ: Mapping[str, str]) -> str:
    """The language of the locale, as `es_MX.UTF-8`; English where there is no folder of it."""
    locale = next(filter(None, map(environ.get, VARIABLES)), "")
    name = locale.partition(".")[0].partition("_")[0].lower()
    return name if name not in ("", "c", "posix", ENGLISH) and name in known() else ENGLISH
