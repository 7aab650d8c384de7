// SPDX-License-Identifier: MIT
// PURPOSE  lines of text to numbers: "1.23,4.56", "1.23 4.56", "ax:1.23 ay:4.56", "1.23;4.56"
// METHOD   cut at the line end; comma, semicolon and tab end a number and blanks part numbers; a label before ':' or '='
//          is skipped, an empty place is NaN. Anything else makes the line damaged: it has no check sum of its own
#include <drv/decoder.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LONGEST_LINE = 2048, LONGEST_NUMBER = 40, MOST_FIELDS = 252 };

static int is_mark(uint8_t c) { return c == ',' || c == ';' || c == '\t'; }

/// One number, all of it. Hexadecimal numbers and words are refused, "nan" and "inf" are empty places.
static int parse_number(const uint8_t* text, size_t length, double* value) {
    char word[LONGEST_NUMBER + 1];
    if (length == 0 || length > LONGEST_NUMBER) return 0;
    for (size_t i = 0; i < length; ++i) {
        if (text[i] == 'x' || text[i] == 'X' || text[i] == 'p' || text[i] == 'P' || text[i] == '(') return 0;
        word[i] = (char)text[i];
    }
    word[length] = '\0';
    char* end = NULL;
    *value = strtod(word, &end);
    if (end != word + length) return 0;
    if (!isfinite(*value)) *value = NAN;
    return 1;
}

static int put(drv_packet_t* packet, double value) {
    if (packet->fields == MOST_FIELDS) return 0;
    packet->values[packet->fields++] = value;
    return 1;
}

/// @return 1 when every place of the line is a number or empty, and one at least is a number
static int parse_line(const uint8_t* line, size_t length, drv_packet_t* packet) {
    int filled = 0, numbers = 0, labelled = 0; // of the place at hand; in all; a label waits for its number
    packet->fields = 0;
    for (size_t at = 0; at < length;) {
        if (is_mark(line[at])) {
            if (labelled || (!filled && !put(packet, NAN))) return 0;
            filled = 0;
            ++at;
        } else if (line[at] == ' ') {
            ++at;
        } else {
            const size_t begin = at;
            size_t number = at;
            for (; at < length && line[at] != ' ' && !is_mark(line[at]); ++at) {
                if (line[at] < ' ' || line[at] > 126) return 0;
                if (line[at] == ':' || line[at] == '=') number = at + 1;
            }
            labelled = number == at && number > begin;
            if (labelled) continue;
            double value;
            if (!parse_number(line + number, at - number, &value) || !put(packet, value)) return 0;
            filled = 1;
            numbers += !isnan(value);
        }
    }
    return numbers > 0 && !labelled;
}

drv_scan_t drv_scan_ascii(const uint8_t* bytes, size_t count, drv_packet_t* packet, size_t* used) {
    const size_t look = count < LONGEST_LINE ? count : LONGEST_LINE;
    const uint8_t* end = memchr(bytes, '\n', look);
    *used = 0;
    if (!end) {
        if (look < LONGEST_LINE) return DRV_SCAN_MORE;
        *used = look;
        return DRV_SCAN_NOISE;
    }
    size_t length = (size_t)(end - bytes);
    *used = length + 1;
    while (length > 0 && (bytes[length - 1] == '\r' || bytes[length - 1] == ' ')) --length;
    if (length == 0) return DRV_SCAN_IDLE;
    if (!parse_line(bytes, length, packet)) return DRV_SCAN_DAMAGED;
    packet->counted = packet->timed = 0;
    packet->first_field = 0;
    packet->samples = 1;
    return DRV_SCAN_PACKET;
}
