// SPDX-License-Identifier: MIT
/// @file candump.h
/// One line of a `candump -L` log: "(1700000000.123456) can0 123#0011", "123##1AA" (FD), "123#R" (remote).
#ifndef DRV_CANDUMP_H
#define DRV_CANDUMP_H

#include <drv/frame.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Room for every line drv_candump_format() can write, end of string included.
enum { DRV_CANDUMP_BYTES = 208 };

/// Why a line was refused.
typedef struct drv_candump_error_t {
    int32_t column;       ///< 1-based
    const char* expected; ///< static text
    char found[24];       ///< the characters there, "end of line" when there are none
} drv_candump_error_t;

/// Parse one line without its line end; a trailing carriage return, blanks and a direction letter are tolerated.
/// @param interface  out, DRV_NAME_BYTES characters, NUL-terminated
/// @return 0, or -1 with `error` filled (may be NULL)
int drv_candump_parse(const char* line, size_t length, drv_frame_t* frame, char* interface, drv_candump_error_t* error);

/// Write one line without line end, stamp at microseconds. @return characters written, -1 when capacity is too small
int drv_candump_format(char* out, size_t capacity, const char* interface, const drv_frame_t* frame);

#ifdef __cplusplus
}
#endif
#endif
