// SPDX-License-Identifier: MIT
// PURPOSE  lines of the slcan protocol <-> frames and commands
// METHOD   the first letter says the kind of frame and the number of identifier digits; what is left over behind the data
//          is either nothing or the four digits of a time stamp
// REFERENCE LAWICEL CAN232 manual (t T r R, S s O C, Z); CANable 2 firmware (d D = FD, b B = FD with fast data, Y)
#include <drv/slcan.h>

#include <stdio.h>
#include <string.h>

static const uint8_t fd_length[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

static int digit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    return -1;
}

/// @return 1, or 0 when one of them is no hexadecimal digit
static int hex(const char* text, unsigned digits, uint32_t* value) {
    *value = 0;
    for (unsigned i = 0; i < digits; ++i) {
        const int one = digit(text[i]);
        if (one < 0) return 0;
        *value = *value << 4 | (uint32_t)one;
    }
    return 1;
}

int drv_slcan_parse(const char* line, size_t length, drv_frame_t* frame, int* stamp_ms) {
    *stamp_ms = -1;
    if (length == 0) return 0;
    const char* kind = strchr("tTrRdDbB", line[0]);
    if (!kind || line[0] == '\0') return strchr("zZVvNFAGg", line[0]) && line[0] != '\0' ? 0 : -1;
    const int which = (int)(kind - "tTrRdDbB");
    const unsigned digits = line[0] < 'a' ? 8 : 3, fd = which >= 4, remote = which == 2 || which == 3;
    uint32_t code, byte;
    if (length < 1 + digits + 1 || !hex(line + 1, digits, &frame->id) || !hex(line + 1 + digits, 1, &code)) return -1;
    if (frame->id > (digits == 3 ? 0x7FFU : 0x1FFFFFFFU) || (!fd && code > 8)) return -1;
    frame->flags = (uint8_t)((digits == 8 ? DRV_FRAME_EXTENDED : 0) | (remote ? DRV_FRAME_REMOTE : 0) |
                             (fd ? DRV_FRAME_FD : 0) | (which >= 6 ? DRV_FRAME_BRS : 0));
    frame->len = fd_length[code];
    const size_t begin = 2 + (size_t)digits, data = remote ? 0 : (size_t)frame->len * 2;
    if (length != begin + data && length != begin + data + 4) return -1;
    memset(frame->data, 0, sizeof frame->data);
    for (size_t i = 0; i < data / 2; ++i) {
        if (!hex(line + begin + 2 * i, 2, &byte)) return -1;
        frame->data[i] = (uint8_t)byte;
    }
    if (length > begin + data) {
        if (!hex(line + begin + data, 4, &code) || code >= DRV_SLCAN_STAMP_MS) return -1;
        *stamp_ms = (int)code;
    }
    return 1;
}

int drv_slcan_format(char* out, size_t capacity, const drv_frame_t* frame) {
    if (frame->flags & DRV_FRAME_ERROR) return -1;
    const int extended = (frame->flags & DRV_FRAME_EXTENDED) != 0, remote = (frame->flags & DRV_FRAME_REMOTE) != 0;
    const int fd = (frame->flags & DRV_FRAME_FD) != 0, fast = fd && (frame->flags & DRV_FRAME_BRS);
    unsigned code = 0;
    while (code < 15 && fd_length[code] < frame->len) ++code;
    if (frame->len > (fd ? 64 : 8) || capacity < DRV_SLCAN_BYTES) return -1;
    const char kind = "tTrRdDbB"[(fast ? 6 : fd ? 4 : remote ? 2 : 0) + extended];
    int at = snprintf(out, capacity, extended ? "%c%08X%X" : "%c%03X%X", kind, (unsigned)frame->id, code);
    for (unsigned i = 0; !(remote && !fd) && i < fd_length[code]; ++i)
        at += snprintf(out + at, capacity - (size_t)at, "%02X", i < frame->len ? frame->data[i] : 0U);
    out[at++] = '\r';
    return at;
}

int drv_slcan_opening(char* out, size_t capacity, int32_t bitrate, int32_t dbitrate, const char* btr) {
    static const int32_t rates[] = {10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000};
    char rate[32] = "", fast[8] = "";
    if (btr) {
        if (snprintf(rate, sizeof rate, "s%s\r", btr) >= (int)sizeof rate) return -1;
    } else if (bitrate != 0) {
        unsigned which = 0;
        while (which < sizeof rates / sizeof rates[0] && rates[which] != bitrate) ++which;
        if (which == sizeof rates / sizeof rates[0]) return -1;
        snprintf(rate, sizeof rate, "S%u\r", which);
    }
    if (dbitrate != 0) {
        if (dbitrate != 2000000 && dbitrate != 5000000) return -1;
        snprintf(fast, sizeof fast, "Y%d\r", (int)(dbitrate / 1000000));
    }
    // An end of line first: whatever stood half typed in the adapter is over.
    const int length = snprintf(out, capacity, "\rC\r%s%sO\r", rate, fast);
    return length < (int)capacity ? length : -1;
}
