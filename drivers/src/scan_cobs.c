// SPDX-License-Identifier: MIT
// PURPOSE  packets of the project's own serial stream to numbers (docs/wire-protocol.md)
// METHOD   cut at the 0, unstuff, check the sum over everything, then the form
#include <drv/crc.h>
#include <drv/decoder.h>
#include <drv/stream.h>

#include <string.h>

static uint32_t get(const uint8_t* at, unsigned bytes) {
    uint32_t value = 0;
    for (unsigned i = bytes; i-- > 0;) value = value << 8 | at[i];
    return value;
}

static double number(const uint8_t* at, drv_stream_format_t format) {
    if (format == DRV_STREAM_INT16) return (int16_t)get(at, 2);
    if (format == DRV_STREAM_INT24) {
        const int32_t code = (int32_t)(get(at, 3) << 8) / 256; // the sign in its place
        return code;
    }
    const uint32_t bits = get(at, 4);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/// A packet without its stuffing. @return 0 when it is none
static int take(const uint8_t* plain, size_t count, drv_packet_t* packet) {
    static const uint8_t sizes[] = {2, 3, 4};
    if (count < DRV_STREAM_OVERHEAD) return 0;
    if (drv_crc32(0, plain, count - 4) != get(plain + count - 4, 4)) return 0;
    const unsigned format = plain[1], channels = plain[2], samples = plain[3];
    if (plain[0] != DRV_STREAM_VERSION || format > DRV_STREAM_FLOAT32 || channels == 0 || samples == 0) return 0;
    if (count != DRV_STREAM_OVERHEAD + (size_t)channels * samples * sizes[format]) return 0;
    packet->counted = packet->timed = 1;
    packet->sequence = get(plain + 4, 4);
    packet->time_ns = (uint64_t)get(plain + 8, 4) * 1000;
    packet->time_bits = 32;
    packet->first_field = 0;
    packet->fields = (uint16_t)channels;
    packet->samples = (uint16_t)samples;
    for (unsigned i = 0; i < channels * samples; ++i)
        packet->values[i] = number(plain + DRV_STREAM_HEADER + (size_t)i * sizes[format], (drv_stream_format_t)format);
    return 1;
}

drv_scan_t drv_scan_cobs(const uint8_t* bytes, size_t count, drv_packet_t* packet, size_t* used) {
    uint8_t plain[DRV_STREAM_ENCODED];
    const size_t look = count < DRV_STREAM_ENCODED ? count : DRV_STREAM_ENCODED;
    const uint8_t* end = memchr(bytes, 0, look);
    *used = 0;
    if (!end) {
        if (look < DRV_STREAM_ENCODED) return DRV_SCAN_MORE;
        *used = look; // longer than any packet
        return DRV_SCAN_NOISE;
    }
    const size_t length = (size_t)(end - bytes);
    *used = length + 1;
    if (length == 0) return DRV_SCAN_IDLE;
    const ptrdiff_t size = drv_cobs_decode(bytes, length, plain);
    return size > 0 && take(plain, (size_t)size, packet) ? DRV_SCAN_PACKET : DRV_SCAN_DAMAGED;
}
