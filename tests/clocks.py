"""Processes whose clocks are not the system's: a library that shifts CLOCK_REALTIME, by the name of the program."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from pathlib import Path

SOURCE = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static int (*real)(clockid_t, struct timespec *);
static double ahead, drift, began;

static double monotonic(void) {
    struct timespec now;
    real(CLOCK_MONOTONIC, &now);
    return now.tv_sec + 1e-9 * now.tv_nsec;
}

static void begin(void) {
    char line[4096] = "", entry[128];
    int file = open("/proc/self/cmdline", O_RDONLY);
    ssize_t length = read(file, line, sizeof line - 1);
    const char *table = getenv("SHIFTED_CLOCKS");
    close(file);
    for (ssize_t i = 0; i < length; i++) if (!line[i]) line[i] = ' ';
    real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    while (table && *table) {
        size_t size = strcspn(table, ",");
        double by, rate;
        char name[64];
        snprintf(entry, sizeof entry, "%.*s", (int)size, table);
        if (sscanf(entry, "%63[^=]=%lf:%lf", name, &by, &rate) == 3 && strstr(line, name)) ahead = by, drift = rate;
        table += size + (table[size] == ',');
    }
    began = monotonic();
}

int clock_gettime(clockid_t id, struct timespec *now) {
    if (!real) begin();
    int code = real(id, now);
    if (id == CLOCK_REALTIME) {
        long long shift = 1e9 * (ahead + drift * (monotonic() - began));
        long long all = now->tv_sec * 1000000000LL + now->tv_nsec + shift;
        now->tv_sec = all / 1000000000LL;
        now->tv_nsec = all % 1000000000LL;
    }
    return code;
}
"""


def shifted(folder: Path, clocks: Mapping[str, tuple[float, float]]) -> dict[str, str]:
    """The environment in which programs whose command line has one of the names have another clock.

    Each clock is ahead by [s], and runs faster by [s/s].
    """
    source, library = folder / "clock.c", folder / "clock.so"
    source.write_text(SOURCE)
    subprocess.run(["c++", "-x", "c", "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)
    table = ",".join(f"{name}={ahead}:{drift}" for name, (ahead, drift) in clocks.items())
    return {"LD_PRELOAD": str(library), "SHIFTED_CLOCKS": table}
