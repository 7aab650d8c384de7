// SPDX-License-Identifier: MIT
// PURPOSE  packets without zeros, and back
// METHOD   blocks of at most 254 bytes, each led by the distance to the next zero; a full block stands for no zero. The
//          writer stays behind the reader, so that both may share one room
#include <drv/cobs.h>

size_t drv_cobs_encode(const uint8_t* bytes, size_t count, uint8_t* out) {
    size_t lead = 0, at = 1; // where the distance of the open block goes; where the next byte goes
    uint8_t distance = 1;
    for (size_t i = 0; i < count; ++i) {
        const uint8_t byte = bytes[i];
        if (distance == 0xFF) { // full: a block that ends without a zero
            out[lead] = distance;
            lead = at++;
            distance = 1;
        }
        if (byte == 0) {
            out[lead] = distance;
            lead = at++;
            distance = 1;
        } else {
            out[at++] = byte;
            ++distance;
        }
    }
    out[lead] = distance;
    return at;
}

ptrdiff_t drv_cobs_decode(const uint8_t* bytes, size_t count, uint8_t* out) {
    size_t read = 0, written = 0;
    if (count == 0) return -1;
    while (read < count) {
        const uint8_t distance = bytes[read++];
        if (distance == 0 || (size_t)distance - 1 > count - read) return -1;
        for (uint8_t i = 1; i < distance; ++i) {
            if (bytes[read] == 0) return -1;
            out[written++] = bytes[read++];
        }
        if (distance < 0xFF && read < count) out[written++] = 0;
    }
    return (ptrdiff_t)written;
}
