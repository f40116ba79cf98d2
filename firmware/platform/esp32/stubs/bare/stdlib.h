#pragma once

extern "C" void abort(void) __attribute__((noreturn));
