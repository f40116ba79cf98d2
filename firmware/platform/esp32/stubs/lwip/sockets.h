#pragma once

#include <stdint.h>

typedef uint32_t socklen_t;

#define IPPROTO_TCP 6
#define TCP_NODELAY 0x01

extern "C" int setsockopt(int s, int level, int optname, const void* opval, socklen_t optlen);
