// The part of <string.h> that the core and the layer use, for a cross compiler without a C library.
#pragma once

#include <stddef.h>

extern "C" {
void* memcpy(void* to, const void* from, size_t size);
void* memmove(void* to, const void* from, size_t size);
void* memset(void* to, int value, size_t size);
void* memchr(const void* in, int value, size_t size);
int memcmp(const void* one, const void* other, size_t size);
char* strcpy(char* to, const char* from);
char* strcat(char* to, const char* from);
char* strncat(char* to, const char* from, size_t size);
int strcmp(const char* one, const char* other);
int strncmp(const char* one, const char* other, size_t size);
char* strncpy(char* to, const char* from, size_t size);
size_t strlen(const char* text);
size_t strnlen(const char* text, size_t size);
}
