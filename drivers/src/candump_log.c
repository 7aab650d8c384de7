// SPDX-License-Identifier: MIT
// PURPOSE  one line of a candump -L log <-> one frame
// METHOD   a cursor that walks the line once; the first thing that does not fit names its column and what should stand there
#include <drv/candump.h>
#include <drv/source.h>

#include <stdio.h>
#include <string.h>

typedef struct cursor_t {
    const char* line;
    size_t at, length;
    drv_candump_error_t* error;
} cursor_t;

static int refuse(const cursor_t* self, const char* expected) {
    drv_candump_error_t* error = self->error;
    if (!error) return -1;
    error->column = (int32_t)self->at + 1;
    error->expected = expected;
    size_t count = self->length - self->at;
    if (count == 0) {
        memcpy(error->found, "end of line", sizeof "end of line");
        return -1;
    }
    if (count > sizeof error->found - 1) count = sizeof error->found - 1;
    for (size_t i = 0; i < count; ++i) {
        char c = self->line[self->at + i];
        error->found[i] = c >= ' ' && c < 127 ? c : '?';
    }
    error->found[count] = '\0';
    return -1;
}

static int peek(const cursor_t* self) { return self->at < self->length ? (unsigned char)self->line[self->at] : -1; }

/// Of a character, -1 for one that is none and for the end of the line (-1).
static int hex_digit(int c) {
    static const uint8_t digits[256] = {
        ['0'] = 1,  ['1'] = 2,  ['2'] = 3,  ['3'] = 4,  ['4'] = 5,  ['5'] = 6,  ['6'] = 7,  ['7'] = 8,
        ['8'] = 9,  ['9'] = 10, ['A'] = 11, ['B'] = 12, ['C'] = 13, ['D'] = 14, ['E'] = 15, ['F'] = 16,
        ['a'] = 11, ['b'] = 12, ['c'] = 13, ['d'] = 14, ['e'] = 15, ['f'] = 16};
    return c < 0 ? -1 : digits[c] - 1;
}

static int parse_time(cursor_t* self, int64_t* time_ns) {
    if (peek(self) != '(') return refuse(self, "'(' and a time in seconds, as candump -L and -l write");
    ++self->at;
    int64_t seconds = 0, fraction = 0, unit = 1000000000;
    size_t begin = self->at;
    for (int c; (c = peek(self)) >= '0' && c <= '9'; ++self->at) {
        if (self->at - begin >= 10) return refuse(self, "at most 10 digits of seconds");
        seconds = seconds * 10 + (c - '0');
    }
    if (self->at == begin) return refuse(self, "digits of seconds");
    if (seconds > INT64_C(9000000000)) return refuse(self, "a time before the year 2255");
    if (peek(self) == '.') {
        ++self->at;
        for (int c; (c = peek(self)) >= '0' && c <= '9'; ++self->at) {
            if (unit == 1) return refuse(self, "at most 9 digits after the point");
            fraction = fraction * 10 + (c - '0');
            unit /= 10;
        }
    }
    if (peek(self) != ')') return refuse(self, "')' after the time");
    ++self->at;
    *time_ns = seconds * 1000000000 + fraction * unit;
    return 0;
}

static int skip_blanks(cursor_t* self, const char* expected) {
    if (peek(self) != ' ' && peek(self) != '\t') return refuse(self, expected);
    while (peek(self) == ' ' || peek(self) == '\t') ++self->at;
    return 0;
}

static int parse_interface(cursor_t* self, char* interface) {
    size_t begin = self->at;
    while (peek(self) > ' ' && peek(self) < 127) {
        if (self->at - begin >= DRV_NAME_BYTES - 1) return refuse(self, "an interface name of at most 15 characters");
        interface[self->at - begin] = (char)peek(self);
        ++self->at;
    }
    interface[self->at - begin] = '\0';
    return self->at == begin ? refuse(self, "an interface name") : 0;
}

static int parse_id(cursor_t* self, drv_frame_t* frame) {
    size_t begin = self->at;
    uint32_t id = 0;
    for (int digit; self->at - begin < 9 && (digit = hex_digit(peek(self))) >= 0; ++self->at)
        id = id << 4 | (uint32_t)digit;
    size_t digits = self->at - begin;
    self->at = begin;
    if (digits != 3 && digits != 8) return refuse(self, "an identifier of 3 or 8 hexadecimal digits");
    if (digits == 3 && id > 0x7FF) return refuse(self, "an 11-bit identifier, at most 7FF");
    if (digits == 8 && id > 0x3FFFFFFF) return refuse(self, "a 29-bit identifier, at most 1FFFFFFF");
    if (digits == 8) frame->flags |= id & 0x20000000 ? DRV_FRAME_ERROR : DRV_FRAME_EXTENDED;
    frame->id = id & 0x1FFFFFFF;
    self->at = begin + digits;
    return 0;
}

static int parse_data(cursor_t* self, drv_frame_t* frame, size_t most) {
    for (int high; (high = hex_digit(peek(self))) >= 0;) {
        if (frame->len == most)
            return refuse(self, most == 8 ? "at most 8 bytes in a classic frame" : "at most 64 bytes in an FD frame");
        ++self->at;
        int low = hex_digit(peek(self));
        if (low < 0) return refuse(self, "the second hexadecimal digit of a byte");
        ++self->at;
        frame->data[frame->len++] = (uint8_t)(high << 4 | low);
        if (peek(self) == '.') ++self->at;
    }
    return 0;
}

static int fd_length_exists(size_t length) {
    return length <= 8 || length == 12 || length == 16 || length == 20 || length == 24 || length == 32 ||
           length == 48 || length == 64;
}

static int parse_body(cursor_t* self, drv_frame_t* frame) {
    if (peek(self) != '#') return refuse(self, "'#' after the identifier");
    ++self->at;
    if (peek(self) == '#') {
        ++self->at;
        int bits = hex_digit(peek(self));
        if (bits < 0) return refuse(self, "one hexadecimal digit of FD flags");
        ++self->at;
        frame->flags |= DRV_FRAME_FD | (bits & 1 ? DRV_FRAME_BRS : 0) | (bits & 2 ? DRV_FRAME_ESI : 0);
        if (parse_data(self, frame, 64)) return -1;
        return fd_length_exists(frame->len) ? 0 : refuse(self, "an FD length: 0-8, 12, 16, 20, 24, 32, 48 or 64 bytes");
    }
    if (peek(self) == 'R' || peek(self) == 'r') {
        ++self->at;
        frame->flags |= DRV_FRAME_REMOTE;
        if (peek(self) >= '0' && peek(self) <= '8') frame->len = (uint8_t)(self->line[self->at++] - '0');
    } else if (parse_data(self, frame, 8)) {
        return -1;
    }
    if (peek(self) == '_' && hex_digit(self->at + 1 < self->length ? self->line[self->at + 1] : -1) >= 0) self->at += 2;
    return 0;
}

int drv_candump_parse(const char* line, size_t length, drv_frame_t* frame, char* interface,
                      drv_candump_error_t* error) {
    while (length > 0 && (line[length - 1] == '\r' || line[length - 1] == ' ')) --length;
    cursor_t cursor = {line, 0, length, error};
    memset(frame, 0, sizeof *frame);
    if (parse_time(&cursor, &frame->time_ns) || skip_blanks(&cursor, "a blank after the time") ||
        parse_interface(&cursor, interface) || skip_blanks(&cursor, "a blank after the interface name") ||
        parse_id(&cursor, frame) || parse_body(&cursor, frame))
        return -1;
    if (cursor.at == length) return 0;
    size_t mark = cursor.at;
    if (skip_blanks(&cursor, "hexadecimal data or the end of the line")) return -1;
    int letter = peek(&cursor);
    if ((letter == 'R' || letter == 'T') && cursor.at + 1 == length) return 0; // direction, written by candump -x
    cursor.at = mark;
    return refuse(&cursor, "the end of the line");
}

int drv_candump_format(char* out, size_t capacity, const char* interface, const drv_frame_t* frame) {
    static const char digits[] = "0123456789ABCDEF";
    if (capacity < DRV_CANDUMP_BYTES || strlen(interface) >= DRV_NAME_BYTES || frame->len > 64) return -1;
    uint32_t id = frame->flags & DRV_FRAME_ERROR ? frame->id | 0x20000000 : frame->id;
    int eight = (frame->flags & (DRV_FRAME_ERROR | DRV_FRAME_EXTENDED)) != 0;
    int count = snprintf(out, capacity, eight ? "(%010lld.%06lld) %s %08X#" : "(%010lld.%06lld) %s %03X#",
                         (long long)(frame->time_ns / 1000000000), (long long)(frame->time_ns / 1000 % 1000000),
                         interface, (unsigned)id);
    if (count < 0) return -1;
    if (frame->flags & DRV_FRAME_REMOTE) {
        out[count++] = 'R';
        if (frame->len > 0 && frame->len <= 8) out[count++] = digits[frame->len];
    } else {
        if (frame->flags & DRV_FRAME_FD) {
            out[count++] = '#';
            out[count++] = digits[(frame->flags & DRV_FRAME_BRS ? 1 : 0) | (frame->flags & DRV_FRAME_ESI ? 2 : 0)];
        }
        for (unsigned i = 0; i < frame->len; ++i) {
            out[count++] = digits[frame->data[i] >> 4];
            out[count++] = digits[frame->data[i] & 15];
        }
    }
    out[count] = '\0';
    return count;
}
